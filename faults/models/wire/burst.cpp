#include <algorithm>

#include "faults/bits.h"
#include "faults/fault_type.h"
#include "faults/poisson.h"

namespace tiltproof::faults {
namespace {

class Burst : public WireModel {
 public:
  explicit Burst(const WireSetup& setup)
      : length_bits_(setup.parameters.Integer("length_bits")),
        density_(setup.parameters.Number("density")),
        rate_(setup.rate.OrUsual()),
        events_(setup.parameters.Number("rate_hz"), setup.stream) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    {
      BitFlipper bits(chunk, context, rate_.character);
      const auto bit_count = static_cast<std::int64_t>(bits.BitCount());
      std::vector<PoissonEvents::Event> found;
      events_.In(chunk.begin_ns - BitsTime(length_bits_), chunk.begin_ns + BitsTime(bit_count), found);
      for (const PoissonEvents::Event& event : found) {
        const std::int64_t first = FirstBitFrom(event.time_ns - chunk.begin_ns);
        const std::int64_t end = std::min(first + length_bits_, bit_count);
        // One draw for each bit of the burst, hit or not: which bits flip depends only on the burst.
        Random random(event.key);
        for (std::int64_t bit = first; bit < end; ++bit) {
          if (random.Bernoulli(density_) && bit >= 0) bits.Flip(static_cast<std::size_t>(bit));
        }
      }
    }
    out.push_back(std::move(chunk));
  }

 private:
  // A byte's data and parity bits share its time on the wire evenly. Rounded up: no burst is missed.
  TimeNs BitsTime(std::int64_t bit_count) const {
    const std::int64_t byte_bits = rate_.character.content_bits();
    return rate_.BytesTime((bit_count + byte_bits - 1) / byte_bits) + 1;
  }
  // The first bit that begins at or after that time, which is relative to the chunk's begin.
  std::int64_t FirstBitFrom(TimeNs t) const {
    const std::int64_t divisor = rate_.character.bit_count() * kNsPerS;
    const std::int64_t scaled = t * rate_.character.content_bits() * rate_.baud;
    return scaled >= 0 ? (scaled + divisor - 1) / divisor : -(-scaled / divisor);
  }

  std::int64_t length_bits_;
  double density_;
  LineRate rate_;
  PoissonEvents events_;
};

}  // namespace

FaultType WireBurst() {
  return {.name = "wire.burst",
          .summary = "Short disturbances at random times flip runs of bits.",
          .semantics =
              "Models ignition, switching contacts and electrostatic discharge, which know nothing of the "
              "frames. Disturbances come as a Poisson process in time, whether or not something is sent. A "
              "disturbance that falls on an idle line has no effect. Each disturbance lasts `length_bits` "
              "data bits; the data bits of a byte, and its parity bit, share its time evenly. Each bit that "
              "begins within a disturbance is flipped with probability `density`. A disturbance may begin "
              "before a frame and end "
              "after it. On an ideal link, bits are placed as at 921600 baud.",
          .source =
              "IEC 61000-4-4:2012 (electrical fast transients in bursts); Kingman, Poisson Processes, "
              "Oxford University Press, 1993.",
          .parameters = {{.name = "length_bits",
                          .unit = "bit",
                          .kind = ParameterKind::kInteger,
                          .min = 1,
                          .max = 10'000,
                          .doc = "length of a disturbance in data bits",
                          .example = 12.0},
                         {.name = "density",
                          .unit = "1",
                          .min = 0.0,
                          .max = 1.0,
                          .doc = "probability that a bit of a disturbance is flipped",
                          .example = 0.5,
                          .zero = 0.0},
                         RateParameter("disturbances per second of time", 100.0)},
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Burst>(setup);
                           }}};
}

}  // namespace tiltproof::faults
