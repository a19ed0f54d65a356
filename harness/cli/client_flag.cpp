// Boost 1.74's Asio uses std::exchange without its header.
#include <utility>
//
#include "harness/cli/client_flag.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <vector>

#include "harness/cli/commands.h"
#include "harness/client/clocked_program.h"
#include "harness/client/firmware_files.h"
#include "harness/client/library_client.h"
#include "harness/client/sanitizer.h"
#include "harness/report/build_id.h"
#include "link/serial_port.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

namespace {

// One file that tells builds of the firmware apart, whatever the scenario; empty when there is none.
std::filesystem::path BuiltFile(const ClientSpec& client) {
  const auto file = FirmwareFile(client, "paper", "paper");
  const auto* image = std::get_if<EmulatedImage>(&client);
  const bool missing = image != nullptr && !std::filesystem::exists(file);
  return missing ? std::filesystem::path() : file;
}

}  // namespace

std::string ClientIdOf(const std::string& text) {
  const std::size_t end =
      text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_");
  return end == std::string::npos || end == 0 || text[end] != '=' ? "" : text.substr(0, end);
}

std::string ClientHelp() {
  std::string help = "Firmware under test, or ID=... for one of a scenario's clients; may be repeated:";
  for (const ClientForm& form : ClientForms()) help += fmt::format("\n  {}: {}", form.form, form.text);
  return help;
}

ClientSpec ReadClientFlag(const std::string& text) {
  try {
    ClientSpec client = ParseClient(text);
    if (std::holds_alternative<HostLibrary>(client)) {
      const auto file = BuiltFile(client);
      if (!std::filesystem::is_regular_file(file))
        throw ClientMistake(fmt::format("no library at {}", file.string()));
      PreloadSanitizer(file);
    }
    return client;
  } catch (const ClientMistake& mistake) {
    throw UsageError(fmt::format("--client {}: {}", text, mistake.what()));
  }
}

RunClients ReadClientFlags(const std::vector<std::string>& texts) {
  RunClients clients;
  bool has_all = false;
  for (const std::string& text : texts) {
    const std::string id = ClientIdOf(text);
    const ClientSpec client = ReadClientFlag(id.empty() ? text : text.substr(id.size() + 1));
    const bool is_new = id.empty() ? !std::exchange(has_all, true) : clients.by_id.emplace(id, client).second;
    if (!is_new)
      throw UsageError(fmt::format("--client {}: {} has one already", text,
                                   id.empty() ? "every client" : fmt::format("client '{}'", id)));
    if (id.empty()) clients.all = client;
  }
  return clients;
}

void CheckClientIds(const RunClients& clients, const std::vector<const Scenario*>& scenarios) {
  std::set<std::string> known;
  for (const Scenario* scenario : scenarios)
    for (std::size_t i = 0; i < scenario->client_count(); ++i) known.insert(scenario->client_id(i));
  for (const auto& [id, client] : clients.by_id)
    if (!known.contains(id))
      throw UsageError(fmt::format("--client {}={}: no scenario has a client '{}'; there are: {}", id,
                                   ToText(client), id, fmt::join(known, ", ")));
}

namespace {

// The file that a command starts with, when the user named one that is no program. A word with anything else in it than the
// characters of a path is for the shell.
std::optional<std::string> MissingProgram(const std::string& command) {
  constexpr std::string_view kPathLetters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+./";
  const std::size_t begin = std::min(command.find_first_not_of(' '), command.size());
  const std::string word = command.substr(begin, command.find(' ', begin) - begin);
  if (word.find('/') == std::string::npos || word.find_first_not_of(kPathLetters) != std::string::npos)
    return std::nullopt;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(word, ignored) && access(word.c_str(), X_OK) == 0) return std::nullopt;
  return std::filesystem::exists(word, ignored) ? word + " is not a program: it must be an executable file"
                                                : "no program at " + word;
}

}  // namespace

void CheckFirmwareFile(const ClientSpec& client) {
  if (const auto* program = std::get_if<LockstepProgram>(&client)) {
    if (const auto mistake = program->clocked ? ClockMistake(program->command) : std::nullopt)
      throw UsageError(fmt::format("--client {}: {}", ToText(client), *mistake));
    if (const auto missing = MissingProgram(program->command))
      throw UsageError(fmt::format("--client {}: {}", ToText(client), *missing));
  }
  if (const auto* image = std::get_if<EmulatedImage>(&client); image != nullptr && !image->file.empty()) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(image->file, ignored))
      throw UsageError(fmt::format("--client {}: {} is not a file", ToText(client), image->file));
  }
  if (!std::holds_alternative<HostLibrary>(client)) return;
  if (const auto mistake = LibraryMistake(BuiltFile(client)))
    throw UsageError(fmt::format("--client {}: {}", ToText(client), *mistake));
}

void CheckPorts(const ClientSpec& client, const Scenario& scenario) {
  const auto* board = std::get_if<SerialBoard>(&client);
  if (board == nullptr) return;
  boost::asio::io_context loop;
  struct Port {
    std::string device;
    std::int64_t baud;
    link::CharacterFormat character;
  };
  const LinkSpec& link = scenario.link;
  std::vector<Port> wanted = {{board->device, link.port_baud(), link.character},
                              {board->reference_device, link.reference_port_baud(), link.character}};
  for (const LineEntry& line : scenario.lines)
    if (const auto device = board->line_devices.find(line.id); device != board->line_devices.end())
      wanted.push_back({device->second, line.baud, {}});
  std::vector<std::unique_ptr<link::SerialPort>> ports;  // all at once, as in flight
  for (const auto& [device, baud, character] : wanted) {
    if (device.empty()) continue;
    const bool is_socket = link::IsSocketName(device);
    try {
      // An emulator may begin as soon as it is connected, so that a socket is only looked for.
      if (const auto trouble = is_socket ? link::SocketTrouble(device) : std::nullopt)
        throw std::runtime_error(*trouble);
      if (is_socket) continue;
      ports.push_back(std::make_unique<link::SerialPort>(loop, device, baud, character));
    } catch (const std::runtime_error& error) {
      const std::string text = fmt::format("--client {}: {}", ToText(client), error.what());
      std::error_code ignored;
      const std::string file = is_socket ? device.substr(device.find(':') + 1) : device;
      if (!std::filesystem::exists(file, ignored)) throw UsageError(text);
      throw std::runtime_error(text);
    }
  }
}

std::string BuildOf(const RunClients& clients) {
  std::vector<std::string> builds;
  for (const ClientSpec& client : clients.Named()) builds.push_back(BuildId(BuiltFile(client)));
  return fmt::format("{}", fmt::join(builds, ","));
}

bool Emulates(const std::vector<ClientSpec>& clients) {
  return std::any_of(clients.begin(), clients.end(),
                     [](const ClientSpec& client) { return std::holds_alternative<EmulatedImage>(client); });
}

std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string ClientFlagsOf(const RunClients& clients) {
  std::string flags = " --client " + Quoted(ToText(clients.all));
  for (const auto& [id, client] : clients.by_id) flags += " --client " + Quoted(id + "=" + ToText(client));
  return flags;
}

}  // namespace tiltproof::harness
