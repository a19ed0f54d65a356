// Simulates a receiver of bytes that are sent at another rate than its own, or as other characters. It samples the
// waveform of the sender's bits where the receiver samples.
//
// The receiver waits for a falling edge and then samples each bit of its character once, up to the first stop bit. Its
// tolerance decides where in the bit it samples, so that it understands a sender just within the tolerance, but not one
// just beyond it. A slow sender's stop bit is missed first, because the last data bit is taken for it. With a fast sender
// it is again the stop bit, because the start bit of the next byte is taken for it.
//
//   LineSampler sampler;
//   sampler.Put(begin_ns, byte, sender_bit_ns);
//   for (const auto& received : sampler.Take(now_ns, receiver_bit_ns, tolerance)) ...
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "link/character.h"
#include "link/time.h"

namespace tiltproof::harness {

class LineSampler {
 public:
  struct Received {
    TimeNs begin_ns, end_ns;  // of its start bit; of the sample of its stop bit
    std::uint16_t word;       // the data bits, lowest first, and behind them the parity bit
    bool framing_error;       // the stop bit was not one
    bool parity_error;        // the parity bit does not fit the data bits
  };

  // Puts a byte on the line, not before the end of the previous one. `parity_error`: with the wrong parity bit.
  void Put(TimeNs begin_ns, std::uint8_t byte, double sender_bit_ns, const link::CharacterFormat& format = {},
           bool parity_error = false);
  // The bytes received up to `known_until_ns`, by a receiver of characters of that format; every byte that begins before
  // that must have been put.
  std::vector<Received> Take(TimeNs known_until_ns, double receiver_bit_ns, double tolerance,
                             const link::CharacterFormat& format = {});

 private:
  struct Sent {
    double begin_ns, bit_ns;
    std::uint16_t word;  // as of Received
    link::CharacterFormat format;
    double end_ns() const { return begin_ns + static_cast<double>(format.bit_count()) * bit_ns; }
    // Bit 0 is the start bit; the stop bits are behind the word.
    bool Bit(std::int64_t i) const {
      return i > format.content_bits() || (i > 0 && (word >> (i - 1) & 1) != 0);
    }
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
