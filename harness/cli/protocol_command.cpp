#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "harness/cli/protocol_flag.h"
#include "harness/cli/range_warnings.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/protocol/c_header.h"
#include "harness/protocol/line_load.h"
#include "harness/report/files.h"
#include "harness/run/message_binding.h"
#include "harness/scenario/protocol_file.h"
#include "harness/scenario/scenario.h"
#include "harness/scenario/schema.h"
#include "harness/scenario/shipped_protocols.h"
#include "harness/terminal/terminal.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

using Json = nlohmann::ordered_json;

namespace {

using link::Direction;
using link::MessageField;
using link::MessageType;
using link::Protocol;

struct CheckOptions {
  std::string protocol, model = Scenario().model, format = "table";
  link::LineRate rate;
  std::string character = std::string(Name(rate.character));
};

// "8E1". Throws UsageError.
link::CharacterFormat ReadCharacter(std::string_view text) {
  for (const std::int64_t data_bits : {7, 8})
    for (const link::Parity parity : {link::Parity::kNone, link::Parity::kEven, link::Parity::kOdd})
      for (const std::int64_t stop_bits : {1, 2})
        if (const link::CharacterFormat format{data_bits, parity, stop_bits}; Name(format) == text)
          return format;
  throw UsageError(fmt::format(
      "--character {}: must be 7 or 8 data bits, the parity N, E or O, and 1 or 2 stop bits, such as 8N1",
      text));
}

// Empty: the protocol is a shipped one.
std::filesystem::path FileOf(const CheckOptions& options) {
  return FindProtocol(options.protocol) != nullptr ? "" : options.protocol;
}

// "file:line:col" of the field, of the messages when it is none of the file's; the name of a shipped protocol.
std::string PlaceOf(const CheckOptions& options, const ProtocolField& field) {
  const std::filesystem::path file = FileOf(options);
  if (file.empty()) return options.protocol;
  if (field.first != nullptr)
    if (std::string place = FieldPlace(file, *field.first, *field.second); !place.empty()) return place;
  const YamlMark mark = PlaceOf(LoadProtocolFile(file).root, "messages");
  return fmt::format("{}:{}:{}", file.string(), mark.line, mark.column);
}

// The protocol as the vehicle speaks it. Throws UsageError when it cannot.
std::shared_ptr<const Protocol> ForModel(const CheckOptions& options, const plant::VehicleModel& model) {
  const VehicleSignals signals = model.signals();
  auto own = ForVehicle(ReadProtocolFlag(options.protocol, ""), signals);
  ProtocolField field;
  if (const std::string problem = UnsuitableProtocol(*own, signals, &field); !problem.empty())
    throw UsageError(fmt::format("{}: {} (--model {})", PlaceOf(options, field), problem, options.model));
  return own;
}

std::string_view LineOf(const MessageType& type) {
  return type.direction == Direction::kReference ? "reference" : "main";
}
std::string_view SenderOf(const MessageType& type) {
  return type.direction == Direction::kToPlant ? "client" : "server";
}

// The number of an id as its file has it.
double IdNumber(const link::MessageId& id) {
  std::array<std::uint8_t, 8> bytes{};
  link::StoreBits(id.type, id.order, id.bits, bytes);
  return link::LoadNumber(id.type, id.order, bytes);
}

// The time at which a message is sent.
std::string WhenSent(const Protocol& protocol, const MessageType& type) {
  if (type.period_ns > 0) return fmt::format("every {:g} ms", static_cast<double>(type.period_ns) / kNsPerMs);
  if (CountEachPeriod(protocol, type))
    return type.direction == Direction::kToClient ? "each request" : "each period";
  return type.starts ? "at the start" : "at will";
}

double Period_s(const Protocol& protocol) {
  return static_cast<double>(protocol.control_period_ns) / static_cast<double>(kNsPerS);
}

// The time of all messages of a direction in one control period, and its share of that period.
struct Share {
  LineLoad load;
  double least_s = 0, most_s = 0, least = 0, most = 0;
};
Share ShareOf(const Protocol& protocol, Direction direction, const link::LineRate& rate) {
  Share share{.load = LineLoadOf(protocol, direction)};
  share.least_s = LineTime_s(share.load.bytes, rate);
  share.most_s = LineTime_s(share.load.bytes_max, rate);
  share.least = share.least_s / Period_s(protocol);
  share.most = share.most_s / Period_s(protocol);
  return share;
}

Json ToJson(const MessageField& field) {
  constexpr std::array kContents = {"signal", "sequence", "time_us"};
  constexpr std::array kUnits = {"newton", "share", "share_of_speed"};
  return {{"signal", field.signal},
          {"type", Name(field.type)},
          {"byte_order", Name(field.order)},
          {"offset", field.offset},
          {"scale", field.scale},
          {"min", field.min},
          {"max", field.max},
          {"content", kContents.at(static_cast<std::size_t>(field.content))},
          {"as", kUnits.at(static_cast<std::size_t>(field.as))}};
}

Json ToJson(const Protocol& protocol, const MessageType& type) {
  const FrameBytes frame = FrameBytesOf(*protocol.framing, type.payload_bytes);
  Json json = {{"name", type.name},
               {"role", Name(type.kind)},
               {"from", SenderOf(type)},
               {"line", LineOf(type)},
               {"id", nullptr},
               {"reply", type.reply.empty() ? Json(nullptr) : Json(type.reply)},
               {"starts", type.starts},
               {"period_ms",
                type.period_ns > 0 ? Json(static_cast<double>(type.period_ns) / kNsPerMs) : Json(nullptr)},
               {"payload_bytes", type.payload_bytes},
               {"frame_bytes", frame.least},
               {"frame_bytes_max", frame.most},
               {"fields", Json::array()}};
  if (type.id)
    json["id"] = {
        {"type", Name(type.id->type)}, {"byte_order", Name(type.id->order)}, {"value", IdNumber(*type.id)}};
  for (const MessageField& field : type.fields) json["fields"].push_back(ToJson(field));
  return json;
}

Json ToJson(const Protocol& protocol, const link::LineRate& rate) {
  const link::Framing& framing = *protocol.framing;
  Json json = {{"protocol", protocol.name},
               {"control_period_ms", Period_s(protocol) * 1e3},
               {"framing",
                {{"type", framing.name()},
                 {"check", Name(framing.check().value_or(link::CheckKind::kNone))},
                 {"check_bytes", framing.check_bytes()}}},
               {"frames",
                {{"world", protocol.world == link::WorldAxes::kEnu ? "enu" : "ned"},
                 {"body", protocol.body == link::BodyAxes::kFlu ? "flu" : "frd"}}},
               {"answers_before_start", protocol.answers_before_start},
               {"repeated_start", protocol.repeated_start_is_boot ? "boot" : "ignored"},
               {"messages", Json::array()},
               {"baud", rate.baud},
               {"character", Name(rate.character)},
               {"load", Json::array()}};
  if (framing.name() == "length_prefixed") {
    const auto sync = framing.special_bytes();
    json["framing"]["sync"] = std::vector<int>(sync.begin(), sync.end());
    json["framing"]["length_bytes"] = framing.Encode({}).size() - framing.check_bytes() - sync.size();
  }
  for (const MessageType& type : protocol.messages) json["messages"].push_back(ToJson(protocol, type));
  for (const Direction direction : link::kDirections) {
    const Share share = ShareOf(protocol, direction, rate);
    json["load"].push_back({{"direction", Name(direction)},
                            {"bytes", share.load.bytes},
                            {"bytes_max", share.load.bytes_max},
                            {"time_s", share.least_s},
                            {"time_max_s", share.most_s},
                            {"share", share.least},
                            {"share_max", share.most}});
  }
  return json;
}

void PrintMessages(const Protocol& protocol) {
  std::size_t width = std::string_view("message").size();
  for (const MessageType& type : protocol.messages) width = std::max(width, type.name.size());
  Print(stdout, "{:<{}} {:<6} {:<9} {:>6} {:>7} {:>5} {:>7}  {}\n", "message", width, "from", "line", "id",
        "payload", "frame", "at most", "sent");
  for (const MessageType& type : protocol.messages) {
    const FrameBytes frame = FrameBytesOf(*protocol.framing, type.payload_bytes);
    Print(stdout, "{:<{}} {:<6} {:<9} {:>6} {:>7} {:>5} {:>7}  {}\n", type.name, width, SenderOf(type),
          LineOf(type), type.id ? fmt::format("{:g}", IdNumber(*type.id)) : "-", type.payload_bytes,
          frame.least, frame.most, WhenSent(protocol, type));
  }
}

void PrintLoad(const Protocol& protocol, const link::LineRate& rate) {
  Print(stdout, "\nEach control period of {:g} ms, at {} baud ({}):\n", Period_s(protocol) * 1e3, rate.baud,
        Name(rate.character));
  Print(stdout, "{:<10} {:>8} {:>8} {:>9} {:>9} {:>7} {:>7}\n", "direction", "bytes", "at most", "ms",
        "at most", "share", "at most");
  for (const Direction direction : link::kDirections) {
    const Share share = ShareOf(protocol, direction, rate);
    Print(stdout, "{:<10} {:>8.4g} {:>8.4g} {:>9.3f} {:>9.3f} {:>5.1f} % {:>5.1f} %\n", Name(direction),
          share.load.bytes, share.load.bytes_max, share.least_s * 1e3, share.most_s * 1e3, share.least * 100,
          share.most * 100);
  }
}

int ProtocolCheckCommand(const CheckOptions& options) {
  const std::shared_ptr<const plant::VehicleModel> model = LoadModelFlag(options.model);
  const std::shared_ptr<const Protocol> protocol = ForModel(options, *model);
  const link::Framing& framing = *protocol->framing;
  if (options.format == "json") {
    Print(stdout, "{}\n", TextLines(ToJson(*protocol, options.rate).dump(2)));
  } else {
    Print(stdout, "{}: framing {}, check {} ({} bytes)\n\n", protocol->name, framing.name(),
          Name(framing.check().value_or(link::CheckKind::kNone)), framing.check_bytes());
    PrintMessages(*protocol);
    PrintLoad(*protocol, options.rate);
  }
  for (const Direction direction : link::kDirections) {
    const Share share = ShareOf(*protocol, direction, options.rate);
    if (share.least > 1)
      throw UsageError(
          fmt::format("{}: the messages {} take {:.3f} ms, longer than the control period of {:g} ms: raise "
                      "--baud, or send less",
                      options.protocol, Name(direction), share.least_s * 1e3, Period_s(*protocol) * 1e3));
    if (share.most > 1)
      Print(stderr,
            "warning: {}: the messages {} do not fit into the control period when every byte is stuffed\n",
            options.protocol, Name(direction));
  }
  for (const std::string& warning : HoverWarnings(*protocol, FileOf(options), *model))
    Print(stderr, "warning: {}\n", warning);
  if (options.format != "json") Print(stdout, "\nIt fits the vehicle '{}'.\n", options.model);
  return kExitGreen;
}

int ProtocolHeaderCommand(const std::string& name, const std::filesystem::path& out) {
  const std::string text = CHeader(*ReadProtocolFlag(name, ""));
  if (std::filesystem::is_directory(out))
    throw UsageError(fmt::format("--out {}: is a folder; give a file", out.string()));
  if (out.has_parent_path()) std::filesystem::create_directories(out.parent_path());
  if (out.empty())
    Print(stdout, "{}", TextLines(text));
  else
    WriteFile(out, text);
  return kExitGreen;
}

}  // namespace

void RegisterProtocol(CLI::App& program, CommandLine& line) {
  CLI::App* command = program.add_subcommand(
      "protocol", "Check a protocol file, and write a C header that speaks the protocol");
  command->require_subcommand(1);
  constexpr const char* kProtocolHelp = "A protocol file, or the name of a shipped protocol";

  const auto options = std::make_shared<CheckOptions>();
  CLI::App* check = command->add_subcommand(
      "check",
      "Print a protocol's messages, the bytes of each control period, and whether a vehicle has its signals");
  check->add_option("FILE", options->protocol, kProtocolHelp)->required();
  check->add_option("--model", options->model, "The vehicle: a model's name, or a path ending in .sdf")
      ->capture_default_str();
  check->add_option("--baud", options->rate.baud, "Rate of all lines, in baud")
      ->check(CLI::Range(std::int64_t{300}, std::int64_t{20'000'000}))
      ->capture_default_str();
  check
      ->add_option("--character", options->character,
                   "Data bits, parity and stop bits of a byte: 8N1, 8E1, 7O2, ...")
      ->capture_default_str();
  check
      ->add_option("--format", options->format,
                   "table or json; json has every field with its place and range")
      ->check(CLI::IsMember({"table", "json"}))
      ->capture_default_str();
  check->footer(
      "`frame` is the length of a frame in which no byte needs stuffing, `at most` that of one in which all "
      "do. A share "
      "is the part of a control period in which a direction of a line is busy. What keeps a line busy for "
      "longer than "
      "the period is an error (2), as is a signal that the vehicle lacks. docs/protocol.md describes the "
      "file.");
  SetAction(*check, line, [options] {
    options->rate.character = ReadCharacter(options->character);
    return ProtocolCheckCommand(*options);
  });

  SetAction(*command->add_subcommand("schema", "Print the JSON Schema of protocol files, for editors"), line,
            [] {
              Print(stdout, "{}\n", TextLines(ProtocolJsonSchema()));
              return kExitGreen;
            });

  const auto name = std::make_shared<std::string>();
  const auto out = std::make_shared<std::filesystem::path>();
  CLI::App* header = command->add_subcommand(
      "header",
      "Write a freestanding C header: structs of the messages, encoders, and a decoder for each byte");
  header->add_option("FILE", *name, kProtocolHelp)->required();
  header->add_option("--out", *out, "The file to write (default: standard output)");
  header->footer(
      "C99 and C++11, without a library: the header suits a host and a microcontroller. It accepts what the "
      "harness "
      "accepts. Names begin with that of the protocol.");
  SetAction(*header, line, [name, out] { return ProtocolHeaderCommand(*name, *out); });
}

}  // namespace tiltproof::harness
