#include "harness/client/firmware_files.h"

#include <fmt/format.h>

#include <optional>

#include "harness/scenario/protocol_file.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// A file that an installed program has in lib/tiltproof, and one in a build folder elsewhere.
std::filesystem::path Shipped(const std::filesystem::path& installed, const std::filesystem::path& built) {
  const auto there = ProgramFolder().parent_path() / "lib/tiltproof" / installed;
  return std::filesystem::exists(there) ? there : ProgramFolder() / built;
}

std::filesystem::path ImageFile(const EmulatedImage& image, const std::string& firmware,
                                const std::string& dialect) {
  if (!image.file.empty()) return image.file;
  return Shipped("stm32f4", "firmware/stm32f4") /
         fmt::format("{}-{}{}.elf", image.scheduler, firmware, dialect == "paper" ? "" : "-" + dialect);
}

}  // namespace

std::filesystem::path ProgramFile() { return std::filesystem::read_symlink("/proc/self/exe"); }

std::filesystem::path ProgramFolder() { return ProgramFile().parent_path(); }

std::filesystem::path ShippedLibrary(const std::string& name) {
  return Shipped(name, std::filesystem::path("lib") / name);
}

std::filesystem::path LockstepPlugin() { return ShippedLibrary("tiltproof_lockstep.so"); }

std::filesystem::path FirmwareFile(const ClientSpec& client, const std::string& firmware,
                                   const std::string& dialect) {
  if (const auto* image = std::get_if<EmulatedImage>(&client)) return ImageFile(*image, firmware, dialect);
  const auto* library = std::get_if<HostLibrary>(&client);
  if (library == nullptr) return {};
  if (!library->file.empty()) return library->file;
  return ShippedLibrary("libtiltproof_firmware.so");
}

std::string HowToGetImages() {
  return std::filesystem::exists(ProgramFolder().parent_path() / "lib/tiltproof")
             ? "this installation has none: install the Debian package, or run `./setup --images` in the "
               "sources and install them again"
             : "run `./setup --images`, which fetches the compiler and the emulator, and builds the images";
}

EmulatorSpec BoardOf(const EmulatedImage& image, const std::string& firmware, const link::Protocol& protocol,
                     std::size_t place, const std::vector<std::string>& lines) {
  const std::optional<link::FrameEnd> end = protocol.framing->frame_end();
  Check(end.has_value(), "frames of a protocol end with a flag, or have a length in front");
  std::vector<int> line_usarts;
  for (const std::string& line : lines) {
    const auto usart = LineUsart(image, line, line_usarts.size());
    if (!usart)
      throw std::runtime_error(
          fmt::format("{}: the line '{}' has no USART: add ,{}=usartN", ToText(image), line, line));
    line_usarts.push_back(*usart);
  }
  return {.image = ImageFile(image, firmware, DialectOf(protocol)).string(),
          .plugin = LockstepPlugin().string(),
          .main_usart = image.main_usart,
          .reference_usart = image.reference_usart,
          .console_usart = image.console_usart,
          .line_usarts = line_usarts,
          .hse_hz = image.hse_hz,
          .place = static_cast<std::uint32_t>(place),
          .frame_end = *end};
}

}  // namespace tiltproof::harness
