// The numbers of a flight: tracking, attitude, control, timing, link, firmware, survival. docs/criteria.md
// defines each.
#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Range of a metric, had this machine taken no time from the flight. Infinite where that is not known.
struct UndisturbedRange {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
};

struct Metrics {
  // By dotted name. A metric that this flight or client does not supply is absent. All are finite.
  std::map<std::string, double> values;
  // In real time, when this machine took time from the flight: those of `values` that this changes. The others are sound.
  std::map<std::string, UndisturbedRange> undisturbed;
  // Set when the error had not settled at the end of the flight: tracking.settling_s is absent, and it is at
  // least this long.
  std::optional<double> settling_at_least_s;
  // When the first fault began that was ever active.
  std::optional<TimeNs> faults_onset_ns;
};

// Throws std::invalid_argument when the trace lacks a column or its times are broken.
Metrics ComputeMetrics(const Scenario& scenario, const RunLog& log);

// Every name that ComputeMetrics may give.
const std::vector<std::string>& MetricNames();

// The p-quantile, p = numerator / denominator in (0, 1], by nearest rank: the smallest sample such that at
// least a share p of all samples is not larger. `sorted` is ascending and not empty.
double NearestRank(const std::vector<double>& sorted, std::size_t numerator, std::size_t denominator);

}  // namespace tiltproof::harness
