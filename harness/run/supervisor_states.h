// A firmware's reports of its own state and role, as columns of the trace. The harness asks a client during the flight
// (Client::Sample) and keeps only changes. They become the column when the flight is over: a trace has it only
// when the client reports a state.
//
//   const std::vector<ToldChange> changes = {{0, 0}, {12 * kNsPerMs, 3}};
//   AddTold(SupervisorStateColumn(scenario, 0), changes, kNever, log.trace);  // supervisor_state: 0, 3, 3, ...
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "harness/run/trace.h"
#include "harness/scenario/scenario.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

// From this time on, in simulation time.
struct ToldChange {
  TimeNs time_ns = 0;
  std::uint32_t value = 0;  // the firmware's own numbering
  friend bool operator==(const ToldChange&, const ToldChange&) = default;
  TILTPROOF_FIELDS(time_ns, value)
};

// supervisor_state, or with several clients supervisor_state_<id>.
std::string SupervisorStateColumn(const Scenario& scenario, std::size_t client);

// role_<id>, for each of several clients.
std::string RoleColumn(const Scenario& scenario, std::size_t client);

// Appends the column; NaN before the first change, and from `until_ns` on. A client that said nothing gets none, unless the
// trace has no rows: then nothing is claimed, and formulas find every name.
void AddTold(const std::string& column, std::span<const ToldChange> changes, TimeNs until_ns, Trace& trace);

}  // namespace tiltproof::harness
