// The events of a flight, up to the number that a person will read. The rest is only counted, in the metrics.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "harness/run/run_log.h"

namespace tiltproof::harness {

template <class Time>
class EventLog {
 public:
  static constexpr std::size_t kEventsMax = 10'000;

  // `client`: the client that the event belongs to; none: the event belongs to the flight.
  void Add(Time time_ns, std::string kind, std::string text, std::optional<std::size_t> client = {}) {
    if (count_ > kEventsMax) return;
    if (count_++ == kEventsMax) {
      kind = "events_suppressed";
      text = "more than " + std::to_string(kEventsMax) + " events: the rest is counted in the metrics only";
    }
    events_.push_back({time_ns, std::move(kind), std::move(text), client});
  }

  // Those added since the last call.
  std::vector<TimedEvent<Time>> Take() { return std::exchange(events_, {}); }

 private:
  std::vector<TimedEvent<Time>> events_;
  std::size_t count_ = 0;
};

}  // namespace tiltproof::harness
