// When a fault acts: its window, its message, every nth, and a probability.
#pragma once

#include <bitset>
#include <cstdint>
#include <optional>

#include "faults/fault.h"
#include "faults/model.h"
#include "faults/random.h"

namespace tiltproof::faults {

class Trigger {
 public:
  // `stream`: key of the random stream of `probability`. `message`: the place in the protocol's table of the only
  // message that it sees; nullopt: it sees all.
  Trigger(const FaultSpec& spec, std::uint64_t stream, std::optional<std::uint8_t> message = std::nullopt)
      : message_(message),
        every_nth_count_(spec.every_nth_count),
        probability_(spec.probability),
        stream_(stream) {}

  // Frames of another message are neither seen nor counted.
  bool Sees(std::uint8_t message) const { return !message_ || *message_ == message; }

  // Counts one more frame or sample that it sees in its window; true when the fault acts on it. The draw
  // belongs to `number`, the number of the frame or sample.
  bool Picks(std::uint64_t number) {
    ++seen_count_;
    if (seen_count_ % every_nth_count_ != 0) return false;
    return probability_ >= 1.0 || Random(KeyOf(stream_, number)).Bernoulli(probability_);
  }

 private:
  std::optional<std::uint8_t> message_;
  std::int64_t every_nth_count_;
  double probability_;
  std::uint64_t stream_;
  std::int64_t seen_count_ = 0;
};

}  // namespace tiltproof::faults
