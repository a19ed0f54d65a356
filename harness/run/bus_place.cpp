#include "harness/run/bus_place.h"

#include <fmt/format.h>

#include <algorithm>

namespace tiltproof::harness {

void TellPlace(RunLog& log, const BusPlace& place) {
  // A board may have spoken before t = 0.
  TimeNs first_ns = 0;
  for (const RunEvent& event : log.events) first_ns = std::min(first_ns, event.time_ns);
  log.events.insert(log.events.begin(),
                    {first_ns, "bus",
                     fmt::format("domain {}, tag {}, run id {}; docs/distributed.md shows how to listen",
                                 place.domain, place.tag, place.run_id)});
}

}  // namespace tiltproof::harness
