// Simulates a receiver of bytes that are sent at another rate than its own. It samples the waveform of the
// sender's 8N1 bits where the receiver samples.
//
// The receiver waits for a falling edge and then samples each of ten bits once. Its tolerance decides where
// in the bit it samples, so that it understands a sender just within the tolerance, but not one just beyond
// it. A slow sender's stop bit is missed first, because the last data bit is taken for it. With a fast sender it is
// again the stop bit, because the start bit of the next byte is taken for it.
//
//   LineSampler sampler;
//   sampler.Put(begin_ns, byte, sender_bit_ns);
//   for (const auto& received : sampler.Take(now_ns, receiver_bit_ns, tolerance)) ...
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

class LineSampler {
 public:
  struct Received {
    TimeNs begin_ns, end_ns;  // of its start bit; of the sample of its stop bit
    std::uint8_t byte;
    bool framing_error;  // the stop bit was not one
  };

  // Puts a byte on the line, not before the end of the previous one.
  void Put(TimeNs begin_ns, std::uint8_t byte, double sender_bit_ns);
  // The bytes received up to `known_until_ns`; every byte that begins before that must have been put.
  std::vector<Received> Take(TimeNs known_until_ns, double receiver_bit_ns, double tolerance);

 private:
  struct Sent {
    double begin_ns, bit_ns;
    std::uint8_t byte;
    double end_ns() const { return begin_ns + 10 * bit_ns; }
    // Bit 0 is the start bit, 9 the stop bit.
    bool Bit(int i) const { return i == 9 || (i > 0 && (byte >> (i - 1) & 1) != 0); }
  };
  struct Edge {
    double at_ns, bit_ns;
  };
  bool Level(double at_ns) const;
  std::optional<Edge> FallingEdge() const;

  std::deque<Sent> sent_;
  double looks_from_ns_ = 0;  // for the next start bit
};

}  // namespace tiltproof::harness
