#include "harness/cli/data_files.h"

#include <fmt/format.h>

#include "harness/cli/commands.h"

namespace tiltproof::harness {
namespace {

std::filesystem::path ProgramFolder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

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

std::filesystem::path FirmwareLibrary(const std::string& client) {
  constexpr std::string_view kLibrary = "library:";
  std::filesystem::path library;
  if (client == "host") {
    library = HostFirmwareLibrary();
  } else if (client.starts_with(kLibrary)) {
    if (client.size() == kLibrary.size()) throw UsageError("--client library: names no file");
    library = std::filesystem::absolute(client.substr(kLibrary.size()));
  } else if (client.starts_with("process:") || client.starts_with("serial:")) {
    throw UsageError(
        fmt::format("--client {}: such a client knows no virtual time and cannot fly in lockstep; use host "
                    "or library:FILE",
                    client));
  } else {
    throw UsageError(fmt::format("--client {}: unknown kind of client; use host or library:FILE", client));
  }
  if (!std::filesystem::is_regular_file(library))
    throw UsageError(fmt::format("--client {}: no library at {}", client, library.string()));
  return library;
}

}  // namespace tiltproof::harness
