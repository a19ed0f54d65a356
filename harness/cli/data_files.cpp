#include "harness/cli/data_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>

#include "harness/cli/commands.h"

namespace tiltproof::harness {
namespace {

std::filesystem::path ProgramFolder() { return ProgramFile().parent_path(); }

// qemu, qemu:freertos, qemu:FILE[,main=usart1][,reference=usart2][,console=usart3]
void ReadEmulator(const std::string& client, ClientChoice& choice) {
  choice.emulator = true;
  if (client == "qemu") return;
  const auto wrong = [&](std::string_view why) {
    throw UsageError(fmt::format("--client {}: {}", client, why));
  };
  std::string_view rest = std::string_view(client).substr(std::string_view("qemu:").size());
  const auto next = [&rest] {
    const std::string_view part = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), part.size() + 1));
    return part;
  };
  const std::string_view what = next();
  if (what.empty()) wrong("names no image; use qemu, qemu:executive, qemu:freertos or qemu:FILE.elf");
  if (what == "executive" || what == "freertos") {
    choice.scheduler = what;
  } else {
    choice.image = std::filesystem::absolute(what);
    choice.text = fmt::format("qemu:{}{}{}", choice.image.string(), rest.empty() ? "" : ",", rest);
  }
  while (!rest.empty()) {
    const std::string_view option = next();
    const std::size_t equals = option.find('=');
    const std::string_view line = option.substr(0, equals);
    const std::string_view usart = equals == option.npos ? "" : option.substr(equals + 1);
    const bool valid = usart.size() == 6 && usart.starts_with("usart") && usart[5] >= '1' && usart[5] <= '6';
    int* const number = line == "main"        ? &choice.main_usart
                        : line == "reference" ? &choice.reference_usart
                        : line == "console"   ? &choice.console_usart
                                              : nullptr;
    if (number == nullptr || !valid)
      wrong(
          fmt::format("'{}' is none of main=usartN, reference=usartN, console=usartN with N from 1 to 6 (a "
                      "path with a comma cannot be given)",
                      option));
    *number = usart[5] - '0';
  }
  if (choice.main_usart == choice.reference_usart || choice.main_usart == choice.console_usart ||
      choice.reference_usart == choice.console_usart)
    wrong(fmt::format("main line, reference line and console need a USART each; they are on {}, {} and {}",
                      choice.main_usart, choice.reference_usart, choice.console_usart));
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

std::filesystem::path ProgramFile() { return std::filesystem::read_symlink("/proc/self/exe"); }

std::filesystem::path LockstepPlugin() {
  const auto installed = ProgramFolder().parent_path() / "lib/tiltproof/tiltproof_lockstep.so";
  return std::filesystem::exists(installed) ? installed : ProgramFolder() / "lib/tiltproof_lockstep.so";
}

std::filesystem::path FirmwareImage(const std::string& scheduler, const std::string& firmware,
                                    link::Dialect dialect) {
  const auto installed = ProgramFolder().parent_path() / "lib/tiltproof/stm32f4";
  const auto folder = std::filesystem::exists(installed) ? installed : ProgramFolder() / "firmware/stm32f4";
  return folder / fmt::format("{}-{}{}.elf", scheduler, firmware,
                              dialect == link::Dialect::kProvant ? "-provant" : "");
}

std::filesystem::path ClientChoice::FirmwareFile(const Scenario& scenario) const {
  if (!emulator) return library;
  return image.empty() ? FirmwareImage(scheduler, scenario.firmware, scenario.link.dialect) : image;
}

std::filesystem::path ClientChoice::BuiltFile() const {
  if (!emulator) return library;
  const auto file = image.empty() ? FirmwareImage(scheduler, "paper", link::Dialect::kPaper) : image;
  return std::filesystem::exists(file) ? file : std::filesystem::path();
}

ClientSource ClientChoice::SourceFor(const Scenario& scenario) const {
  if (!emulator) return {.library = library.string(), .emulator = std::nullopt};
  return {.library = {},
          .emulator = EmulatorSpec{.image = FirmwareFile(scenario).string(),
                                   .plugin = LockstepPlugin().string(),
                                   .main_usart = main_usart,
                                   .reference_usart = reference_usart,
                                   .console_usart = console_usart}};
}

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
  if (client.starts_with("qemu,"))
    throw UsageError(
        fmt::format("--client {}: USARTs follow an image: qemu:executive{}", client, client.substr(4)));
  if (client == "qemu" || client.starts_with("qemu:")) {
    ReadEmulator(client, choice);
    choice.has_our_builds = choice.image.empty();
    return choice;
  }
  if (client == "host") {
    choice.library = HostFirmwareLibrary();
    choice.has_our_builds = true;
  } else if (const auto file = rest_of("library:")) {
    choice.library = std::filesystem::absolute(*file);
    choice.text = "library:" + choice.library.string();
  } else {
    throw UsageError(
        fmt::format("--client {}: unknown kind of client; use host, library:FILE, "
                    "qemu[:executive|:freertos|:ELF], process:CMD or "
                    "serial:DEV[,REFDEV]",
                    client));
  }
  if (!std::filesystem::is_regular_file(choice.library))
    throw UsageError(fmt::format("--client {}: no library at {}", client, choice.library.string()));
  return choice;
}

}  // namespace tiltproof::harness
