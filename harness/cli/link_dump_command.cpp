#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>

#include "harness/cli/protocol_flag.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/run/link_log.h"
#include "harness/run/message_order.h"
#include "harness/terminal/terminal.h"
#include "link/hdlc_framing.h"

namespace tiltproof::harness {

namespace {

// The scenario beside the log; none when the log was moved.
std::optional<Scenario> ScenarioBeside(const std::filesystem::path& file) {
  try {
    return LoadFlown(file.parent_path()).scenario;
  } catch (const UsageError&) {
    return std::nullopt;
  }
}

// Ids of the clients and lines in the log's records. The scenario has their names; without it their numbers are shown.
std::vector<std::string> OwnerIds(const LinkLog& log, const std::optional<Scenario>& scenario) {
  std::size_t count = 1;
  std::size_t offset = 0;
  while (const auto record = log.Next(offset)) count = std::max(count, record->wire.client + 1);
  std::vector<std::string> ids;
  for (std::size_t i = 0; i < count; ++i) ids.push_back(std::to_string(i));
  if (count == 1 || !scenario) return ids;
  const std::size_t known = scenario->client_count() + scenario->lines.size();
  for (std::size_t i = 0; i < std::min(count, known); ++i) ids[i] = scenario->wire_owner_id(i);
  return ids;
}

// The line between boards of such a wire; null: it is of a client's line, or the log was moved.
const LineEntry* LineOf(const std::optional<Scenario>& scenario, std::size_t owner) {
  if (!scenario || owner < scenario->client_count()) return nullptr;
  const std::size_t line = owner - scenario->client_count();
  return line < scenario->lines.size() ? &scenario->lines[line] : nullptr;
}

// "to_plant"; of a line between boards "to_a", for the client at its end.
std::string DirectionText(const std::optional<Scenario>& scenario, const WireId& wire) {
  const LineEntry* line = LineOf(scenario, wire.client);
  if (line == nullptr) return std::string(Name(wire.direction));
  return "to_" + line->between.at(wire.direction == link::Direction::kToClient ? 0 : 1);
}

// One line a decoded frame or rejection: time of the record that completed it, direction, side, status, and
// the payload; and one for what the buffer of an adapter passed on at once.
struct LinkDumpOptions {
  std::filesystem::path file;
  std::string protocol;  // empty: that of the scenario
};

// " " and the message of a payload, or without a protocol " " and its numbers as the built-in ones have them.
std::string MeaningOf(const link::Protocol* protocol, link::Direction direction,
                      std::span<const std::uint8_t> payload) {
  if (protocol != nullptr) {
    const std::string text = MessageText(*protocol, direction, payload);
    return text.empty() ? "" : " " + text;
  }
  if (payload.size() % 4 != 0) return "";
  std::string floats;
  for (std::size_t i = 0; i < payload.size(); i += 4)
    floats += fmt::format(
        " {:.9g}", link::LoadNumber(link::NumberType::kF32, link::ByteOrder::kLittle, payload.subspan(i)));
  return floats;
}

// The receivers of each client or line between boards: of what was sent, and of what was delivered.
class Receivers {
 public:
  // By owner; null without a protocol.
  explicit Receivers(std::span<const link::Protocol* const> protocols) : orders_(protocols.size()) {
    for (std::size_t owner = 0; owner < orders_.size(); ++owner)
      if (protocols[owner] != nullptr)
        for (auto& side : orders_[owner]) side.emplace(*protocols[owner]);
  }
  // " status=stale", for example, of a whole frame that a receiver refuses.
  std::string Refusal(const WireId& wire, bool delivered, std::span<const std::uint8_t> payload) {
    std::optional<MessageOrder>& order = orders_[wire.client][delivered];
    if (!order) return "";
    link::Message message;
    const link::MessageStatus status = order->Decode(wire.direction, payload, message);
    return status == link::MessageStatus::kOk ? "" : fmt::format(" status={}", Name(status));
  }

 private:
  // A start of the firmware begins both directions again.
  std::vector<std::array<std::optional<MessageOrder>, 2>> orders_;
};

LinkLog ReadLog(const std::filesystem::path& file) {
  std::string content;
  try {
    content = ReadFile(file);
  } catch (const FileError& error) {
    throw UsageError(error.what());
  }
  try {
    return LinkLog({content.begin(), content.end()});
  } catch (const std::exception& error) {
    throw UsageError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

int LinkDumpCommand(const LinkDumpOptions& options) {
  const std::filesystem::path& file = options.file;
  const LinkLog log = ReadLog(file);
  const std::optional<Scenario> scenario = ScenarioBeside(file);
  const std::vector<std::string> ids = OwnerIds(log, scenario);
  const std::shared_ptr<const link::Protocol> protocol = !options.protocol.empty()
                                                             ? ReadProtocolFlag(options.protocol)
                                                         : scenario ? scenario->link.protocol
                                                                    : nullptr;
  // The built-in protocols have one framing: a log that was moved is read too.
  const link::Framing& framing = protocol == nullptr ? *link::HdlcFraming() : *protocol->framing;
  // Sent and delivered bytes are two streams in each direction of each client.
  std::vector<std::array<std::array<std::unique_ptr<link::FrameReader>, 2>, link::kDirectionCount>> readers(
      ids.size());
  const auto protocol_of = [&](std::size_t owner) {
    const LineEntry* line = LineOf(scenario, owner);
    return line == nullptr ? protocol.get() : line->protocol.get();
  };
  // Bytes as they are: the log's records are all that is known of them.
  const auto is_raw = [&](std::size_t owner) {
    return LineOf(scenario, owner) != nullptr && protocol_of(owner) == nullptr;
  };
  for (std::size_t owner = 0; owner < readers.size(); ++owner)
    for (auto& direction : readers[owner])
      for (auto& side : direction)
        side = (LineOf(scenario, owner) == nullptr || is_raw(owner) ? framing : *protocol_of(owner)->framing)
                   .MakeReader();
  std::vector<const link::Protocol*> protocols;
  for (std::size_t owner = 0; owner < ids.size(); ++owner) protocols.push_back(protocol_of(owner));
  Receivers receivers(protocols);
  const auto print = [&](TimeNs time_ns, std::size_t client, std::size_t direction, bool delivered,
                         const link::FrameReading& read) {
    const auto way = static_cast<link::Direction>(direction);
    const std::string meaning = read.ok ? MeaningOf(protocol_of(client), way, read.payload) +
                                              receivers.Refusal({client, way}, delivered, read.payload)
                                        : "";
    Print(stdout, "{:>14.9f} {}{:<9} {:<9} {:<16} {:3} {}{}{}\n", ToSeconds(time_ns),
          ids.size() > 1 ? ids[client] + " " : "", DirectionText(scenario, {client, way}),
          delivered ? "delivered" : "sent", read.status, read.payload.size(),
          fmt::format("{:02x}", fmt::join(read.payload, "")), meaning.empty() ? "" : "  =", meaning);
  };
  Print(stdout, "# begin_s {}direction side status bytes payload = {}\n", ids.size() > 1 ? "client " : "",
        protocol == nullptr ? "floats" : "message");
  std::size_t offset = 0;
  TimeNs last_ns = 0;
  while (const auto record = log.NextOfAll(offset)) {
    const std::size_t client = record->wire.client;
    const auto direction = static_cast<std::size_t>(record->wire.direction);
    if (record->passed_on || is_raw(client)) {
      const char* side = record->passed_on ? "passed_on" : record->delivered ? "delivered" : "sent";
      Print(stdout, "{:>14.9f} {}{:<9} {:<9} {:<16} {:3} {}\n", ToSeconds(record->begin_ns),
            ids.size() > 1 ? ids[client] + " " : "", DirectionText(scenario, record->wire), side,
            record->passed_on ? "-" : "bytes", record->bytes.size(),
            fmt::format("{:02x}", fmt::join(record->bytes, "")));
      continue;
    }
    auto bytes = record->bytes;
    last_ns = record->begin_ns;
    while (const auto read = readers[client][direction][record->delivered]->Next(bytes))
      print(record->begin_ns, client, direction, record->delivered, *read);
  }
  for (std::size_t client = 0; client < readers.size(); ++client)
    for (std::size_t d = 0; d < link::kDirectionCount; ++d)
      for (const bool delivered : {false, true})
        if (const auto read = readers[client][d][delivered]->Finish())
          print(last_ns, client, d, delivered, *read);
  return kExitGreen;
}

}  // namespace

void RegisterLinkDump(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<LinkDumpOptions>();
  CLI::App* command = program.add_subcommand("link-dump", "Print a link.bin as decoded frames");
  command->add_option("FILE", options->file, "link.bin of a scenario")->required();
  command->add_option("--protocol", options->protocol,
                      "A built-in protocol or a protocol file (default: that of the scenario beside FILE)");
  SetAction(*command, line, [options] { return LinkDumpCommand(*options); });
}

}  // namespace tiltproof::harness
