// Events at random times, as from noise: a Poisson process over the time of the line.
//
// The events of each second are drawn from that second's own generator, so they do not depend on what passes
// on the line: neither on frames nor on the order of queries. (Independent increments make the pieces one
// Poisson process.) Events that fall on an idle line have no effect.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "faults/random.h"
#include "link/time.h"

namespace tiltproof::faults {

class PoissonEvents {
 public:
  PoissonEvents(double rate_hz, std::uint64_t stream) : rate_hz_(rate_hz), stream_(stream) {}

  struct Event {
    BootTime time_ns;
    std::uint64_t key;  // of a generator for this event
  };
  // Appends the events in [from, to) to `events`, in order of time.
  void In(BootTime from_ns, BootTime to_ns, std::vector<Event>& events);

 private:
  struct Second {
    std::int64_t number = -1;
    std::vector<Event> events;
  };
  const Second& Load(std::int64_t number);

  double rate_hz_;
  std::uint64_t stream_;
  std::array<Second, 2> seconds_;  // the latest even one and odd one
};

}  // namespace tiltproof::faults
