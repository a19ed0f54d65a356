#include <algorithm>

#include "faults/bits.h"
#include "faults/fault_type.h"
#include "faults/poisson.h"
#include "link/check.h"

namespace tiltproof::faults {
namespace {

class StuckByte : public WireModel {
 public:
  explicit StuckByte(const WireSetup& setup)
      : value_(static_cast<std::uint8_t>(setup.parameters.Integer("value"))),
        length_bytes_(setup.parameters.Integer("length_bytes")),
        rate_(setup.rate.OrUsual()),
        events_(setup.parameters.Number("rate_hz"), setup.stream) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const auto byte_count = static_cast<std::int64_t>(chunk.bytes.size());
    std::vector<PoissonEvents::Event> found;
    events_.In(chunk.begin_ns - rate_.BytesTime(length_bytes_) - 1,
               chunk.begin_ns + rate_.BytesTime(byte_count) + 1, found);
    for (const PoissonEvents::Event& event : found) {
      const std::int64_t first = FirstByteFrom(event.time_ns - chunk.begin_ns);
      const std::int64_t end = std::min(first + length_bytes_, byte_count);
      for (std::int64_t i = std::max<std::int64_t>(first, 0); i < end; ++i) {
        const auto index = static_cast<std::size_t>(i);
        CheckIndex(index, chunk.bytes.size(), "a stuck byte is one of the chunk's");
        std::uint8_t& byte = chunk.bytes[index];
        if (context.what != nullptr && byte != value_) context.Say(ByteChange(index, byte, value_));
        byte = value_;
        if (!chunk.parity_errors.empty()) chunk.parity_errors[index] = 0;
      }
    }
    out.push_back(std::move(chunk));
  }

 private:
  // The first byte that begins at or after that time, which is relative to the chunk's begin.
  std::int64_t FirstByteFrom(TimeNs t) const {
    const std::int64_t divisor = rate_.character.bit_count() * kNsPerS;
    const std::int64_t scaled = t * rate_.baud;
    return scaled >= 0 ? (scaled + divisor - 1) / divisor : -(-scaled / divisor);
  }

  std::uint8_t value_;
  std::int64_t length_bytes_;
  LineRate rate_;
  PoissonEvents events_;
};

}  // namespace

FaultType WireStuckByte() {
  return {
      .name = "wire.stuck_byte",
      .summary = "At random times the line reads the same value for a number of bytes.",
      .semantics =
          "Models a receiver that hands over what is not data: a bus that nothing drives reads FF, a buffer "
          "that was cleared 00. Events come as a Poisson process in time, whether or not something is sent. "
          "An event that falls on an idle line has no effect. Bytes that begin within `length_bytes` byte "
          "times of an event are replaced by `value`. On an ideal link, bytes are placed as at 921600 baud.",
      .source = "IEC 61508-2:2010, Table A.1 (stuck-at faults of data).",
      .parameters = {{.name = "value",
                      .unit = "1",
                      .kind = ParameterKind::kInteger,
                      .min = 0,
                      .max = 255,
                      .doc = "the value that is read, 0 to 255",
                      .example = 255.0},
                     {.name = "length_bytes",
                      .unit = "byte",
                      .kind = ParameterKind::kInteger,
                      .min = 1,
                      .max = 10'000,
                      .doc = "for how many byte times the line is stuck",
                      .example = 4.0},
                     RateParameter("events per second of time", 100.0)},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<StuckByte>(setup);
                       }}};
}

}  // namespace tiltproof::faults
