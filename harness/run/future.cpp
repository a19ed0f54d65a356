#include "harness/run/future.h"

#include <algorithm>

#include "link/check.h"

namespace tiltproof::harness {

Scenario WithFuture(Scenario scenario, const Future& future) {
  for (const std::size_t fault : future.cut) {
    CheckIndex(fault, scenario.faults.size(), "a future cuts faults of its scenario");
    faults::FaultSpec& spec = scenario.faults[fault];
    const TimeNs from_ns = std::max<TimeNs>(future.from_ns, 0);
    spec.start_ns = std::min(spec.start_ns, from_ns);
    spec.end_ns = std::min(spec.end_ns, from_ns);
  }
  return scenario;
}

}  // namespace tiltproof::harness
