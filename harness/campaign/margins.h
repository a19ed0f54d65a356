// Finds the margins of many faults at once: one search each, whose trials share the workers.
//
//   Trials trials({.jobs_count = 2});
//   const std::vector<MarginTask> tasks = {{.job = job, .fault = 0, .severity = severity}};
//   for (const std::optional<Margin>& margin : FindMargins(trials, tasks, {.tolerance = 0.01})) Report(margin);
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/fault_level.h"
#include "harness/campaign/trials.h"
#include "link/fields.h"

namespace tiltproof::harness {

struct MarginTask {
  FlightJob job;          // with the scenario; its name begins those of the flights
  std::size_t fault = 0;  // whose severity is changed
  Severity severity;
};

struct Margin {
  std::optional<double> survives, fails;  // as in MarginSearch, as is what follows
  std::vector<LevelAnswer> levels;
  std::vector<Pocket> pockets;
  std::optional<double> survived_share;
  std::vector<double> idle_levels;  // those survived at which the fault never acted
  TrialResult at_fails;             // where `fails` is set
  // At some level up to `survives` something was drawn at random, so that the seeds are a sample.
  bool is_random = false;
  std::size_t flights_count = 0;
  // The flight that could not be judged, at a level below all that fail: the search stopped, and there is no margin.
  std::optional<TrialResult> unknown;
  double unknown_level = 0.0;

  // The fault acted at no level, and all are survived: the flights do not test it.
  bool never_acted() const { return !levels.empty() && idle_levels.size() == levels.size(); }
};

// The reason that there is no margin of a fault that never acted.
std::string WhyNeverActed(const Margin& margin);

// Certainty of a margin, as files have it (docs/margins.md): the levels that were flown, the pockets among them, and the
// seeds of each level.
struct MarginScan {
  std::vector<LevelAnswer> levels;
  std::vector<Pocket> pockets;
  std::optional<double> survived_share;
  std::vector<double> idle_levels;
  int seeds = 0;
  double sure_share = 0.0;
  TILTPROOF_FIELDS(levels, pockets, survived_share, idle_levels, seeds, sure_share)
};
// `repeat_count`: seeds of each level at which something is drawn at random.
MarginScan ScanOf(const Margin& margin, int repeat_count);

struct FindMarginsOptions {
  double tolerance = 0.01;
  std::size_t at_once_count = 16;  // searches under way
  std::function<void(const MarginTask&, double level, const TrialResult&)> on_level = [](const auto&, double,
                                                                                         const auto&) {};
  // As they end; `task` is the place among the tasks.
  std::function<void(std::size_t task, const Margin&)> on_done = [](std::size_t, const auto&) {};
};

// With a confidence of 95 %, the least share of all seeds that pass where `count` of them were drawn and all passed: the
// one-sided bound of Clopper and Pearson, 0.05^(1 / count). 59 of 59 give 95 %.
double SurePassShare(int count);

// In the order of the tasks. None: the search was interrupted, or the trials stopped.
std::vector<std::optional<Margin>> FindMargins(Trials& trials, const std::vector<MarginTask>& tasks,
                                               const FindMarginsOptions& options);

}  // namespace tiltproof::harness
