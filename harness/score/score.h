// Scoring: computes metrics, criteria and a verdict from a scenario and the log of its flight. Pure: no
// clock, no client, no files.
//
//   const Score score = ScoreRun(scenario, log);  // after the flight, or from its files years later
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "harness/score/histogram.h"
#include "harness/score/metrics.h"
#include "harness/score/stl.h"
#include "harness/score/verdict_cause.h"
#include "link/fields.h"

namespace tiltproof::harness {

struct CriterionResult {
  std::string name;
  Verdict verdict = Verdict::kInconclusive;
  // > 0: the criterion holds. For a formula in scaled units; for a metric its distance to the nearer bound,
  // in its own unit. None: nothing to measure (the implicit criteria, a metric that is absent). Infinite for
  // a formula that no number bounds (docs/criteria.md).
  std::optional<double> robustness;
  // Time of the row that decided: the first violation or witness, otherwise the smallest margin. Metrics have
  // none.
  std::optional<double> time_s;
  std::string explanation;  // one line for a person: formula or bound, value, time
  // Comparable with the margins of other criteria: the robustness of a formula as it is; for a metric the
  // distance to each bound divided by that bound's magnitude, the smaller of the two. A bound of 0, infinite values, and an
  // exact value (min = max) that is met have none.
  std::optional<double> margin{};
  // In a flight with faults: false when no fault can have changed what decided (harness/score/headline.h).
  std::optional<bool> fault_can_affect{};
  // The robustness of a formula over time, where it was asked for (ScoreOptions).
  std::optional<stl::OverTime> over_time{};
  static constexpr std::array<std::string_view, 1> kNotInFiles = {"over_time"};
  TILTPROOF_FIELDS(name, verdict, robustness, margin, fault_can_affect, time_s, explanation, over_time)
};

// In real time: a flight is not judged when the harness itself was late in more than this share of its
// control periods and more than kOverrunCountMax times, or once by more than kLatePeriodsMax periods.
inline constexpr double kOverrunRatioMax = 0.01;
inline constexpr std::int64_t kOverrunCountMax = 3;
inline constexpr std::int64_t kLatePeriodsMax = 3;

struct FaultResult {
  std::string id, type;
  std::int64_t activations = 0;
  TILTPROOF_FIELDS(id, type, activations)
};

struct Score {
  Verdict verdict = Verdict::kInconclusive;
  std::optional<VerdictCause> cause;  // none: passed, or read from a file of an older version
  std::string reason;  // one line: which criterion, fault or failure decided; empty when passed
  std::map<std::string, double> metrics;  // dotted names, finite; absent when the client cannot supply it
  std::map<std::string, Histogram> histograms;  // request_period_ms, reply_latency_ms; always there
  // `survival`, `control_period` where it can be judged, then the others in the scenario's order.
  std::vector<CriterionResult> criteria;
  std::vector<FaultResult> faults;  // in the scenario's order
  std::int64_t restarts = 0;        // of the firmware, asked for or not
  TILTPROOF_FIELDS(verdict, cause, reason, metrics, histograms, criteria, faults, restarts)
};

// True if a firmware of the flight stated that it computed (TiltproofHost.compute).
bool StatesComputing(const Score& score);
// Reason of a flight in which a fault did nothing.
std::string NeverActivated(const FaultResult& fault, const Score& score);

struct ScoreOptions {
  bool over_time = false;  // the robustness of each formula over time, too
  // The only one of the scenario's criteria that is judged. Metrics and histograms that it does not need are left
  // out. None: all of them are judged.
  std::optional<std::string> only = {};
};

// Never throws: a log that cannot be scored (a trace without its columns) is Verdict::kError with the reason.
Score ScoreRun(const Scenario& scenario, const RunLog& log, const ScoreOptions& options = {});

}  // namespace tiltproof::harness
