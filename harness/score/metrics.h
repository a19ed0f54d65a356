// The numbers of a flight: tracking, attitude, control, timing, link, firmware, survival. docs/criteria.md
// defines each.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

struct Metrics {
  // By dotted name; a metric that this flight or client does not supply is absent. All finite.
  std::map<std::string, double> values;
  // When the error had not settled as the flight ended: tracking.settling_s is absent, but this long at
  // least.
  std::optional<double> settling_at_least_s;
};

// Throws std::invalid_argument when the trace lacks a column or its times are broken.
Metrics ComputeMetrics(const Scenario& scenario, const RunLog& log);

// Every name that ComputeMetrics may give.
const std::vector<std::string>& MetricNames();

// The p-quantile, p = numerator / denominator in (0, 1], by nearest rank: the smallest sample such that at
// least a share p of all is not larger. `sorted` ascending, not empty.
double NearestRank(const std::vector<double>& sorted, std::size_t numerator, std::size_t denominator);

}  // namespace tiltproof::harness
