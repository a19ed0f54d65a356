// Scoring: from a scenario and the log of its flight to metrics, criteria and a verdict. Pure: no clock, no client, no files.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

struct CriterionResult {
  std::string name;
  Verdict verdict = Verdict::kInconclusive;
  std::optional<double> robustness;  // > 0 holds; in scaled units (stl) or in the metric's own (min/max bound)
  std::optional<double> time_s;      // when it was decided: of the violation, or of the worst margin
  std::string explanation;           // one line for a person: formula or bound, value, time
};

struct FaultResult {
  std::string id, type;
  std::int64_t activations = 0;
};

struct Score {
  Verdict verdict = Verdict::kInconclusive;
  std::string reason;  // one line: which criterion, fault or trouble decided
  std::map<std::string, double> metrics;  // dotted names; absent when the client cannot supply it
  std::vector<CriterionResult> criteria;  // `survival` first
  std::vector<FaultResult> faults;
};

Score ScoreRun(const Scenario& scenario, const RunLog& log);

// Names a criterion may use as `metric`.
const std::vector<std::string>& MetricNames();

}  // namespace tiltproof::harness
