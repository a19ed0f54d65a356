#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class BaudMismatch : public WireModel {
 public:
  explicit BaudMismatch(const WireSetup& setup)
      : bit_time_(1 + setup.parameters.Number("ppm") * 1e-6), character_(setup.rate.character) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const std::vector<bool> line = BitsOf(chunk);
    const auto level = [&line](double bit_time) {
      const auto bit = static_cast<std::size_t>(bit_time);
      return bit >= line.size() || line[bit];
    };
    link::Chunk heard = chunk.Part(0, 0);
    for (std::size_t edge = NextEdge(line, 0); edge < line.size();) {
      // The middle of a bit after the start bit; the stop bit is behind the content.
      const auto middle = [&](std::int64_t bit) {
        return static_cast<double>(edge) + (1.5 + static_cast<double>(bit)) * bit_time_;
      };
      unsigned byte = 0;
      for (std::int64_t bit = 0; bit < character_.data_bits; ++bit)
        if (level(middle(bit))) byte |= 1U << bit;
      const auto read = static_cast<std::uint8_t>(byte);
      heard.Append(
          read, character_.has_parity() && level(middle(character_.data_bits)) != character_.ParityBit(read));
      edge = NextEdge(line, static_cast<std::size_t>(middle(character_.content_bits())) + 1);
    }
    if (context.what != nullptr && heard.bytes != chunk.bytes)
      context.Say(std::to_string(heard.bytes.size()) + " bytes read of " +
                  std::to_string(chunk.bytes.size()));
    if (!heard.bytes.empty()) out.push_back(std::move(heard));
  }

 private:
  std::vector<bool> BitsOf(const link::Chunk& chunk) const {
    std::vector<bool> line;
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      const std::uint8_t byte = chunk.bytes[i];
      line.push_back(false);
      for (std::int64_t bit = 0; bit < character_.data_bits; ++bit) line.push_back((byte >> bit & 1) != 0);
      if (character_.has_parity()) line.push_back(character_.ParityBit(byte) != chunk.HasParityError(i));
      line.insert(line.end(), static_cast<std::size_t>(character_.stop_bits), true);
    }
    return line;
  }
  // The first bit at or after `from` that is low and follows a high one; the size when there is none.
  static std::size_t NextEdge(const std::vector<bool>& line, std::size_t from) {
    while (from < line.size() && (line[from] || (from > 0 && !line[from - 1]))) ++from;
    return from;
  }

  double bit_time_;
  link::CharacterFormat character_;
};

}  // namespace

FaultType WireBaudMismatch() {
  return {
      .name = "wire.baud_mismatch",
      .summary = "Sender and receiver disagree on the baud rate.",
      .semantics =
          "Models a wrong divisor or a crystal that is off. The bits of a frame that the trigger picks "
          "are read by a receiver whose bit takes 1 + `ppm` / 10^6 of the sender's bit. It waits for a "
          "falling edge, and samples data bits, parity bit and the first stop bit in the middles of its own "
          "bit times from this edge on. Then it waits for the next edge. It also passes on a byte whose stop "
          "bit "
          "is low. With 8N1, every byte is right below about 5 % of difference (50 000 ppm), because each "
          "begins "
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
