#include <fmt/format.h>

#include <array>
#include <bit>

#include "harness/cli/commands.h"
#include "harness/report/files.h"
#include "harness/run/link_log.h"
#include "harness/terminal/terminal.h"
#include "link/frame.h"
#include "link/messages.h"

namespace tiltproof::harness {

// One line a decoded frame or rejection: time of the record that completed it, direction, side, status, and
// the payload.
int LinkDumpCommand(const std::filesystem::path& file) {
  std::string content;
  try {
    content = ReadFile(file);
  } catch (const FileError& error) {
    throw UsageError(error.what());
  }
  LinkLog log;
  try {
    log = LinkLog({content.begin(), content.end()});
  } catch (const std::exception& error) {
    throw UsageError(fmt::format("{}: {}", file.string(), error.what()));
  }

  // Sent and delivered bytes are two streams in each direction.
  std::array<std::array<link::FrameDecoder, 2>, link::kDirectionCount> decoders;
  const auto print = [](TimeNs time_ns, std::size_t direction, bool delivered,
                        const link::FrameEvent& event) {
    std::string meaning;
    if (event.status == link::FrameStatus::kOk) {
      // By its length alone: a log does not say the dialect, and both share lengths.
      const auto floats = event.payload.size() % 4 == 0 ? event.payload.size() / 4 : 0;
      for (std::size_t i = 0; i < floats; ++i) {
        const auto* b = &event.payload[4 * i];
        const std::uint32_t bits =
            b[0] | (std::uint32_t{b[1]} << 8) | (std::uint32_t{b[2]} << 16) | (std::uint32_t{b[3]} << 24);
        meaning += fmt::format(" {:.9g}", std::bit_cast<float>(bits));
      }
    }
    Print(stdout, "{:>14.9f} {:<9} {:<9} {:<16} {:3} {}{}{}\n", ToSeconds(time_ns),
          Name(static_cast<link::Direction>(direction)), delivered ? "delivered" : "sent", Name(event.status),
          event.payload.size(), fmt::format("{:02x}", fmt::join(event.payload, "")),
          meaning.empty() ? "" : "  =", meaning);
  };
  Print(stdout, "# begin_s direction side status bytes payload = floats\n");
  std::size_t offset = 0;
  TimeNs last_ns = 0;
  while (const auto record = log.Next(offset)) {
    const auto direction = static_cast<std::size_t>(record->direction);
    auto bytes = record->bytes;
    last_ns = record->begin_ns;
    while (const auto event = decoders[direction][record->delivered].Next(bytes))
      print(record->begin_ns, direction, record->delivered, *event);
  }
  for (std::size_t d = 0; d < link::kDirectionCount; ++d)
    for (const bool delivered : {false, true})
      if (const auto event = decoders[d][delivered].Finish()) print(last_ns, d, delivered, *event);
  return kExitGreen;
}

}  // namespace tiltproof::harness
