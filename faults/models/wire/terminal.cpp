#include <array>

#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

constexpr std::uint8_t kLineFeed = 0x0A, kCarriageReturn = 0x0D, kXon = 0x11, kXoff = 0x13;

// The bytes that come out of a terminal for one that goes in: none, one or two.
struct Translation {
  std::array<std::uint8_t, 2> bytes{};
  std::size_t size = 1;
};

Translation Translate(std::string_view flag, std::uint8_t byte) {
  const auto one = [](std::uint8_t value) { return Translation{{value}, 1}; };
  constexpr Translation kNothing{{}, 0};
  if (flag == "ixon" && (byte == kXon || byte == kXoff)) return kNothing;
  if (flag == "igncr" && byte == kCarriageReturn) return kNothing;
  if (flag == "icrnl" && byte == kCarriageReturn) return one(kLineFeed);
  if (flag == "inlcr" && byte == kLineFeed) return one(kCarriageReturn);
  if (flag == "istrip") return one(byte & 0x7F);
  if (flag == "onlcr" && byte == kLineFeed) return {{kCarriageReturn, kLineFeed}, 2};
  return one(byte);
}

class Terminal : public WireModel {
 public:
  explicit Terminal(std::string_view flag) {
    for (std::size_t byte = 0; byte < table_.size(); ++byte)
      table_[byte] = Translate(flag, static_cast<std::uint8_t>(byte));
  }

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    link::Chunk edited = chunk.Part(0, 0);
    edited.bytes.reserve(chunk.bytes.size());
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      const std::uint8_t before = chunk.bytes[i];
      const Translation& after = table_[before];
      for (std::size_t n = 0; n < after.size; ++n) edited.Append(after.bytes[n], chunk.HasParityError(i));
      if (context.what == nullptr || (after.size == 1 && after.bytes[0] == before)) continue;
      if (after.size == 1)
        context.Say(ByteChange(i, before, after.bytes[0]));
      else
        context.Say("byte " + std::to_string(i) + " " + Hex(before) +
                    (after.size == 0 ? " eaten" : " -> " + Hex(after.bytes[0]) + " " + Hex(after.bytes[1])));
    }
    if (!edited.bytes.empty()) out.push_back(std::move(edited));
  }

 private:
  std::array<Translation, 256> table_;
};

}  // namespace

FaultType WireTerminal() {
  return {
      .name = "wire.terminal",
      .summary = "A terminal that is not in raw mode eats or translates bytes.",
      .semantics =
          "Models a program that opens a serial port and forgets raw mode: the terminal's settings for text "
          "stay in force, and change binary data. `flag` names the setting, as termios(3) does. `ixon`: XON "
          "(11) and XOFF (13) are eaten. `igncr`: CR (0d) is eaten. `icrnl`: CR becomes NL (0a). `inlcr`: NL "
          "becomes CR. `istrip`: bit 7 of every byte is cleared. `onlcr`: NL becomes CR NL, one byte more. "
          "All bytes of a frame count, flags included. Bytes behind one that is eaten arrive one byte time "
          "earlier, and behind one that is added, one later. A frame that loses all its bytes vanishes. "
          "`ixon` only eats: in a real terminal XOFF also stops the output until XON. `ixon`, `igncr`, "
          "`icrnl`, `inlcr` and `istrip` act where a terminal reads, `onlcr` where it writes: choose the "
          "`target` accordingly. The usual settings for text have `icrnl`, `ixon` and `onlcr`: add a fault "
          "for each.",
      .source =
          "IEEE Std 1003.1-2017 (POSIX.1), Base Definitions, chapter 11, General Terminal Interface "
          "(sections 11.2.2, input modes, and 11.2.3, output modes); Linux manual page termios(3).",
      .parameters = {{.name = "flag",
                      .unit = "",
                      .kind = ParameterKind::kChoice,
                      .doc = "the terminal's setting that is left in force",
                      .example = "icrnl",
                      .choices = {"ixon", "igncr", "icrnl", "inlcr", "istrip", "onlcr"}}},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<Terminal>(setup.parameters.Choice("flag"));
                       },
                       .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
