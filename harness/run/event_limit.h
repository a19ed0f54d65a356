// Limits the events of one part of a flight to the number that a person will read. The metrics count the rest.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include "harness/run/record.h"

namespace tiltproof::harness {

class EventLimit {
 public:
  static constexpr std::size_t kEventsMax = 10'000;

  // The event to record: this one, after kEventsMax events one that says so, afterwards none.
  std::optional<record::Event> Pass(std::string kind, std::string text) {
    if (count_ > kEventsMax) return std::nullopt;
    if (count_++ < kEventsMax) return record::Event{std::move(kind), std::move(text)};
    return record::Event{"events_suppressed", "more than " + std::to_string(kEventsMax) +
                                                  " events: the rest is counted in the metrics only"};
  }

 private:
  std::size_t count_ = 0;
};

}  // namespace tiltproof::harness
