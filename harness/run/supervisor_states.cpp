#include "harness/run/supervisor_states.h"

#include <limits>

namespace tiltproof::harness {

std::string SupervisorStateColumn(const Scenario& scenario, std::size_t client) {
  std::string name = "supervisor_state";
  if (scenario.has_several_clients()) name.append(1, '_').append(scenario.client_id(client));
  return name;
}

std::string RoleColumn(const Scenario& scenario, std::size_t client) {
  return "role_" + scenario.client_id(client);
}

void AddTold(const std::string& column, std::span<const ToldChange> changes, TimeNs until_ns, Trace& trace) {
  if (changes.empty() && trace.row_count() > 0) return;
  std::vector<double> values(trace.row_count(), std::numeric_limits<double>::quiet_NaN());
  std::size_t next = 0;
  for (std::size_t row = 0; row < values.size(); ++row) {
    if (until_ns != kNever && trace.at(row, 0) >= ToSeconds(until_ns)) break;
    while (next < changes.size() && ToSeconds(changes[next].time_ns) <= trace.at(row, 0)) ++next;
    if (next > 0) values[row] = changes[next - 1].value;
  }
  trace.AppendColumn(column, values);
}

}  // namespace tiltproof::harness
