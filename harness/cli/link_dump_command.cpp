#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <memory>

#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/run/link_log.h"
#include "harness/terminal/terminal.h"
#include "link/frame.h"

namespace tiltproof::harness {

namespace {

// Ids of the clients in the log's records. The scenario beside it has their names; without it their numbers are shown.
std::vector<std::string> ClientIds(const LinkLog& log, const std::filesystem::path& file) {
  std::size_t count = 1;
  std::size_t offset = 0;
  while (const auto record = log.Next(offset)) count = std::max(count, record->wire.client + 1);
  std::vector<std::string> ids;
  for (std::size_t i = 0; i < count; ++i) ids.push_back(std::to_string(i));
  if (count == 1) return ids;
  try {
    const Scenario scenario = LoadFlown(file.parent_path()).scenario;
    for (std::size_t i = 0; i < std::min(count, scenario.client_count()); ++i) ids[i] = scenario.client_id(i);
  } catch (const UsageError&) {
    // It was moved.
  }
  return ids;
}

// One line a decoded frame or rejection: time of the record that completed it, direction, side, status, and
// the payload; and one for what the buffer of an adapter passed on at once.
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

  const std::vector<std::string> ids = ClientIds(log, file);
  // Sent and delivered bytes are two streams in each direction of each client.
  std::vector<std::array<std::array<link::FrameDecoder, 2>, link::kDirectionCount>> decoders(ids.size());
  const auto print = [&](TimeNs time_ns, std::size_t client, std::size_t direction, bool delivered,
                         const link::FrameEvent& event) {
    std::string meaning;
    if (event.status == link::FrameStatus::kOk) {
      // Only by its length: a log does not say the protocol, and the built-in ones share lengths.
      const auto floats = event.payload.size() % 4 == 0 ? event.payload.size() / 4 : 0;
      for (std::size_t i = 0; i < floats; ++i) {
        const auto* b = &event.payload[4 * i];
        const std::uint32_t bits =
            b[0] | (std::uint32_t{b[1]} << 8) | (std::uint32_t{b[2]} << 16) | (std::uint32_t{b[3]} << 24);
        meaning += fmt::format(" {:.9g}", std::bit_cast<float>(bits));
      }
    }
    Print(stdout, "{:>14.9f} {}{:<9} {:<9} {:<16} {:3} {}{}{}\n", ToSeconds(time_ns),
          ids.size() > 1 ? ids[client] + " " : "", Name(static_cast<link::Direction>(direction)),
          delivered ? "delivered" : "sent", Name(event.status), event.payload.size(),
          fmt::format("{:02x}", fmt::join(event.payload, "")), meaning.empty() ? "" : "  =", meaning);
  };
  Print(stdout, "# begin_s {}direction side status bytes payload = floats\n",
        ids.size() > 1 ? "client " : "");
  std::size_t offset = 0;
  TimeNs last_ns = 0;
  while (const auto record = log.NextOfAll(offset)) {
    const std::size_t client = record->wire.client;
    const auto direction = static_cast<std::size_t>(record->wire.direction);
    if (record->passed_on) {
      Print(stdout, "{:>14.9f} {}{:<9} {:<9} {:<16} {:3} {}\n", ToSeconds(record->begin_ns),
            ids.size() > 1 ? ids[client] + " " : "", Name(record->wire.direction), "passed_on", "-",
            record->bytes.size(), fmt::format("{:02x}", fmt::join(record->bytes, "")));
      continue;
    }
    auto bytes = record->bytes;
    last_ns = record->begin_ns;
    while (const auto event = decoders[client][direction][record->delivered].Next(bytes))
      print(record->begin_ns, client, direction, record->delivered, *event);
  }
  for (std::size_t client = 0; client < decoders.size(); ++client)
    for (std::size_t d = 0; d < link::kDirectionCount; ++d)
      for (const bool delivered : {false, true})
        if (const auto event = decoders[client][d][delivered].Finish())
          print(last_ns, client, d, delivered, *event);
  return kExitGreen;
}

}  // namespace

void RegisterLinkDump(CLI::App& program, CommandLine& line) {
  const auto file = std::make_shared<std::filesystem::path>();
  CLI::App* command = program.add_subcommand("link-dump", "Print a link.bin as decoded frames");
  command->add_option("FILE", *file, "link.bin of a scenario")->required();
  SetAction(*command, line, [file] { return LinkDumpCommand(*file); });
}

}  // namespace tiltproof::harness
