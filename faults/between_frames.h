// Events of a Poisson process that are carried out behind the frames of a line: those since the control period of
// the frame before. So nothing enters a line between frames, where a receiver may have gone on already.
//
//   EventsBetweenFrames events(wire_setup);
//   for (const auto& event : events.Since(chunk, wire_context)) ...   // in Act
//   events.Skip(chunk);                                               // in Pass
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "faults/model.h"
#include "faults/poisson.h"

namespace tiltproof::faults {

class EventsBetweenFrames {
 public:
  explicit EventsBetweenFrames(const WireSetup& setup)
      : period_ns_(setup.protocol.control_period_ns),
        events_(setup.parameters.Number("rate_hz"), setup.stream) {}

  // Those between the control period of the frame before and that of this one, while the fault was active. Of a
  // longer pause the last second.
  const std::vector<PoissonEvents::Event>& Since(const link::Chunk& chunk, const WireContext& context) {
    found_.clear();
    if (last_ns_) {
      const BootTime from = std::max(*last_ns_, chunk.begin_ns - kNsPerS);
      events_.In(Counted(from, context), Counted(chunk.begin_ns, context), found_);
    }
    std::erase_if(found_, [&](const PoissonEvents::Event& event) {
      const TimeNs t = event.time_ns.ns();
      return context.origin.known() ? !context.activity.Touches(t, t)
                                    : !context.ActiveWithin(event.time_ns, event.time_ns);
    });
    Skip(chunk);
    return found_;
  }
  void Skip(const link::Chunk& chunk) { last_ns_ = chunk.begin_ns; }

 private:
  // The process runs in simulation time, once that is known: how long a client takes to boot changes nothing.
  // It is counted in whole control periods, so that neither does how fast the client computes.
  BootTime Counted(BootTime t, const WireContext& context) const {
    if (!context.origin.known()) return t;
    const TimeNs since_origin = std::max<TimeNs>(context.origin.SimulationTime(t), 0);
    return BootTime(since_origin - since_origin % period_ns_);
  }

  TimeNs period_ns_;
  PoissonEvents events_;
  std::optional<BootTime> last_ns_;
  std::vector<PoissonEvents::Event> found_;
};

}  // namespace tiltproof::faults
