// A flight that is as it should be, for tests of the score to change and judge.
#pragma once

#include <algorithm>
#include <limits>
#include <string>

#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A flight of `rows` rows that hangs still where it should, every input at hover.
inline RunLog StillFlight(std::size_t rows) {
  RunLog log;
  log.trace = testing::TiltrotorTrace();
  log.hover_input = {10, 10, 0, 0};
  log.input_min = {0, 0, -2, -2};
  log.input_max = {30, 30, 2, 2};
  log.clients[0].starts_accepted_count = 1;
  for (std::size_t r = 0; r < rows; ++r) {
    const auto row = log.trace.AppendRow();
    std::fill(row.begin(), row.end(), 0.0);
    log.end_ns = static_cast<TimeNs>(r) * kControlPeriodNs;
    row[0] = ToSeconds(log.end_ns);
    row[*log.trace.Find("f_r_n")] = row[*log.trace.Find("f_l_n")] = 10.0;
  }
  return log;
}

inline Scenario ScenarioOf(const RunLog& log) {
  Scenario scenario;
  scenario.duration_ns = log.end_ns;
  return scenario;
}

inline faults::FaultSpec Fault(const std::string& id, TimeNs start_ns, TimeNs end_ns) {
  faults::FaultSpec fault;
  fault.id = id;
  fault.type = "wire.bit_error";
  fault.start_ns = start_ns;
  fault.end_ns = end_ns;
  return fault;
}

// The same flight with another value in one column of one row.
inline void Set(RunLog& log, std::size_t r, std::string_view column, double value) {
  Trace changed(log.trace.columns());
  for (std::size_t k = 0; k < log.trace.row_count(); ++k) {
    const auto row = changed.AppendRow();
    std::copy(log.trace.row(k).begin(), log.trace.row(k).end(), row.begin());
    if (k == r) row[*changed.Find(column)] = value;
  }
  log.trace = std::move(changed);
}

}  // namespace tiltproof::harness
