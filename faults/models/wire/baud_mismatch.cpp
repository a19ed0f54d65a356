#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class BaudMismatch : public WireModel {
 public:
  explicit BaudMismatch(const WireSetup& setup) : bit_time_(1 + setup.parameters.Number("ppm") * 1e-6) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const std::vector<bool> line = BitsOf(chunk.bytes);
    const auto level = [&line](double bit_time) {
      const auto bit = static_cast<std::size_t>(bit_time);
      return bit >= line.size() || line[bit];
    };
    std::vector<std::uint8_t> heard;
    for (std::size_t edge = NextEdge(line, 0); edge < line.size();) {
      unsigned byte = 0;
      for (int bit = 0; bit < 8; ++bit)
        if (level(static_cast<double>(edge) + (1.5 + bit) * bit_time_)) byte |= 1U << bit;
      heard.push_back(static_cast<std::uint8_t>(byte));
      edge = NextEdge(line, static_cast<std::size_t>(static_cast<double>(edge) + 9.5 * bit_time_) + 1);
    }
    if (context.what != nullptr && heard != chunk.bytes)
      context.Say(std::to_string(heard.size()) + " bytes read of " + std::to_string(chunk.bytes.size()));
    chunk.bytes = std::move(heard);
    if (!chunk.bytes.empty()) out.push_back(std::move(chunk));
  }

 private:
  // Start bit, eight data bits, low first, stop bit.
  static std::vector<bool> BitsOf(std::span<const std::uint8_t> bytes) {
    std::vector<bool> line;
    for (const std::uint8_t byte : bytes) {
      line.push_back(false);
      for (int bit = 0; bit < 8; ++bit) line.push_back((byte >> bit & 1) != 0);
      line.push_back(true);
    }
    return line;
  }
  // The first bit at or after `from` that is low and follows a high one; the size when there is none.
  static std::size_t NextEdge(const std::vector<bool>& line, std::size_t from) {
    while (from < line.size() && (line[from] || (from > 0 && !line[from - 1]))) ++from;
    return from;
  }

  double bit_time_;
};

}  // namespace

FaultType WireBaudMismatch() {
  return {.name = "wire.baud_mismatch",
          .summary = "Sender and receiver disagree on the baud rate.",
          .semantics =
              "Models a wrong divisor or a crystal that is off. The bits of a frame that the trigger picks "
              "are read by a receiver whose bit takes 1 + `ppm` / 10^6 of the sender's bit. It waits for a "
              "falling edge, and samples eight data bits and a stop bit in the middles of its own bit times "
              "from this edge on. Then it waits for the next edge. It also passes on a byte whose stop bit "
              "is low. Below about 5 % of difference (50 000 ppm) every byte is right, because each begins "
              "with an edge of its own. Beyond it, bits are read twice or missed, and edges within a byte "
              "are taken for its begin. Before and after the frame the line is high. Nothing is random. The "
              "bytes that are read arrive back to back, from the frame's begin on.",
          .source =
              "Maxim Integrated, Determining Clock Accuracy Requirements for UART Communications, "
              "Application Note 2141, 2003.",
          .parameters = {{.name = "ppm",
                          .unit = "ppm",
                          .min = -500'000.0,
                          .max = 500'000.0,
                          .doc = "how much longer the receiver's bit is than the sender's",
                          .example = 60'000.0,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<BaudMismatch>(setup);
                           },
                           .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
