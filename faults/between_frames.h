// Events of a Poisson process that are carried out behind the frames of a line: those since the frame before. So
// nothing enters a line between frames, where a receiver may have gone on already.
//
//   for (const auto& event : events.Since(chunk, context)) ...   // in Act
//   events.Skip(chunk);                                          // in Pass
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "faults/model.h"
#include "faults/poisson.h"

namespace tiltproof::faults {

class EventsBetweenFrames {
 public:
  EventsBetweenFrames(double rate_hz, std::uint64_t stream) : events_(rate_hz, stream) {}

  // Those between the begin of the frame before and that of this one, while the fault was active. Of a longer
  // pause the last second.
  const std::vector<PoissonEvents::Event>& Since(const link::Chunk& chunk, const WireContext& context) {
    found_.clear();
    if (last_ns_) events_.In(std::max(*last_ns_, chunk.begin_ns - kNsPerS), chunk.begin_ns, found_);
    std::erase_if(found_, [&](const PoissonEvents::Event& event) {
      return !context.ActiveWithin(event.time_ns, event.time_ns);
    });
    Skip(chunk);
    return found_;
  }
  void Skip(const link::Chunk& chunk) { last_ns_ = chunk.begin_ns; }

 private:
  PoissonEvents events_;
  std::optional<BootTime> last_ns_;
  std::vector<PoissonEvents::Event> found_;
};

}  // namespace tiltproof::faults
