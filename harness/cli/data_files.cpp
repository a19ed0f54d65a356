#include "harness/cli/data_files.h"

#include <fmt/format.h>

#include <optional>
#include <string_view>

#include "harness/cli/commands.h"

namespace tiltproof::harness {
namespace {

std::filesystem::path ProgramFolder() { return ProgramFile().parent_path(); }

}  // namespace

std::filesystem::path ModelsFolder() {
  const auto installed = ProgramFolder().parent_path() / "share/tiltproof/models";
  return std::filesystem::exists(installed) ? installed
                                            : std::filesystem::path(TILTPROOF_SOURCE_DIR) / "plant/models";
}

std::filesystem::path HostFirmwareLibrary() {
  const auto installed = ProgramFolder().parent_path() / "lib/tiltproof/libtiltproof_firmware.so";
  return std::filesystem::exists(installed) ? installed : ProgramFolder() / "lib/libtiltproof_firmware.so";
}

std::filesystem::path ProgramFile() { return std::filesystem::read_symlink("/proc/self/exe"); }

ClientChoice ChooseClient(const std::string& client) {
  // What follows "kind:", when the client is of that kind.
  const auto rest_of = [&](std::string_view kind) -> std::optional<std::string> {
    if (!client.starts_with(kind)) return std::nullopt;
    if (client.size() == kind.size()) throw UsageError(fmt::format("--client {} names nothing", client));
    return client.substr(kind.size());
  };
  ClientChoice choice;
  choice.text = client;
  if (const auto command = rest_of("process:")) {
    choice.command = *command;
    return choice;
  }
  if (const auto devices = rest_of("serial:")) {
    const std::size_t comma = devices->find(',');
    choice.device = devices->substr(0, comma);
    if (comma != std::string::npos) choice.reference_device = devices->substr(comma + 1);
    if (choice.device.empty() || (comma != std::string::npos && choice.reference_device.empty()) ||
        choice.reference_device.find(',') != std::string::npos)
      throw UsageError(fmt::format("--client {}: must be serial:DEVICE or serial:DEVICE,DEVICE", client));
    return choice;
  }
  if (client == "host") {
    choice.library = HostFirmwareLibrary();
  } else if (const auto file = rest_of("library:")) {
    choice.library = std::filesystem::absolute(*file);
    choice.text = "library:" + choice.library.string();
  } else {
    throw UsageError(fmt::format(
        "--client {}: unknown kind of client; use host, library:FILE, process:CMD or serial:DEV[,REFDEV]",
        client));
  }
  if (!std::filesystem::is_regular_file(choice.library))
    throw UsageError(fmt::format("--client {}: no library at {}", client, choice.library.string()));
  return choice;
}

}  // namespace tiltproof::harness
