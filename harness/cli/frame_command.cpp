#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <variant>

#include "harness/cli/protocol_flag.h"
#include "harness/cli/shared_options.h"
#include "harness/report/json_text.h"
#include "harness/run/message_order.h"
#include "harness/terminal/terminal.h"
#include "link/hdlc_framing.h"
#include "link/message_kind.h"

namespace tiltproof::harness {
namespace {

std::vector<std::uint8_t> FromHex(std::string_view hex) {
  std::vector<std::uint8_t> bytes;
  if (hex.size() % 2 != 0) throw UsageError(fmt::format("HEX: an odd number of digits ({})", hex.size()));
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    std::uint8_t byte = 0;
    const auto [end, error] = std::from_chars(hex.data() + i, hex.data() + i + 2, byte, 16);
    if (error != std::errc{} || end != hex.data() + i + 2)
      throw UsageError(
          fmt::format("HEX: '{}' at digit {} is not a hexadecimal byte", hex.substr(i, 2), i + 1));
    bytes.push_back(byte);
  }
  return bytes;
}

// The messages that a payload can be, each with its direction and values: a payload does not say its direction. `order`
// has seen the payloads before.
nlohmann::ordered_json MessagesIn(const link::Protocol& protocol, std::span<const std::uint8_t> payload,
                                  MessageOrder& order) {
  nlohmann::ordered_json messages = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < link::kDirectionCount; ++i) {
    const auto direction = static_cast<link::Direction>(i);
    const link::MessageType* type = protocol.Classify(direction, payload);
    if (type == nullptr) continue;
    nlohmann::ordered_json values = nlohmann::ordered_json::object();
    for (std::size_t field = 0; field < type->fields.size(); ++field)
      values[type->fields[field].signal] = link::FieldValue(*type, payload, field);
    link::Message message;
    messages.push_back({{"message", type->name},
                        {"direction", Name(direction)},
                        {"status", Name(order.Decode(direction, payload, message))},
                        {"values", std::move(values)}});
  }
  return messages;
}

// `protocol`: null without --protocol; then the line has no messages, and `order` is null, too.
void PrintFrame(const link::FrameReading& read, const link::Protocol* protocol, MessageOrder* order) {
  const std::string messages =
      protocol != nullptr && read.ok
          ? fmt::format(", \"messages\": {}", JsonLine(MessagesIn(*protocol, read.payload, *order)))
          : "";
  Print(stdout, "{{\"offset\": {}, \"status\": \"{}\", \"payload\": \"{}\"{}}}\n", read.begin, read.status,
        fmt::format("{:02x}", fmt::join(read.payload, "")), messages);
}

// The framing of --protocol; without it the paper's.
struct FrameOptions {
  std::string protocol;  // empty: not stated
  std::shared_ptr<const link::Protocol> Protocol() const {
    return protocol.empty() ? nullptr : ReadProtocolFlag(protocol);
  }
};
const link::Framing& FramingOf(const std::shared_ptr<const link::Protocol>& protocol) {
  return protocol == nullptr ? *link::HdlcFraming() : *protocol->framing;
}

int FrameEncodeCommand(const std::string& hex, const FrameOptions& options) {
  const std::shared_ptr<const link::Protocol> protocol = options.Protocol();
  const auto payload = FromHex(hex);
  const link::Framing& framing = FramingOf(protocol);
  std::size_t most = link::kPayloadBytesMax;
  if (const auto end = framing.frame_end(); end && std::holds_alternative<link::LengthHeader>(*end))
    most = std::get<link::LengthHeader>(*end).payload_bytes_max;
  if (payload.size() > most)
    throw UsageError(fmt::format("HEX: {} bytes; a payload has at most {}", payload.size(), most));
  Print(stdout, "{}\n", fmt::format("{:02x}", fmt::join(framing.Encode(payload), "")));
  return kExitGreen;
}

// An empty path is standard input.
int FrameDecodeCommand(const std::filesystem::path& file, const FrameOptions& options) {
  const std::shared_ptr<const link::Protocol> protocol = options.Protocol();
  if (std::filesystem::is_directory(file))
    throw UsageError(fmt::format("FILE: {} is a folder; give a file of raw bytes", file.string()));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> opened(
      file.empty() ? nullptr : std::fopen(file.c_str(), "rb"), std::fclose);
  if (!file.empty() && !opened)
    throw UsageError(fmt::format("cannot open {}: {}", file.string(), std::strerror(errno)));
  std::FILE* input = file.empty() ? stdin : opened.get();

  const std::unique_ptr<link::FrameReader> reader = FramingOf(protocol).MakeReader();
  std::optional<MessageOrder> order;
  if (protocol != nullptr) order.emplace(*protocol);
  bool rejected = false;
  const auto report = [&](const link::FrameReading& read) {
    PrintFrame(read, protocol.get(), order ? &*order : nullptr);
    rejected |= !read.ok;
  };
  for (int c = 0; (c = std::getc(input)) != EOF;) {
    const auto byte = static_cast<std::uint8_t>(c);
    std::span<const std::uint8_t> bytes(&byte, 1);
    while (const auto read = reader->Next(bytes)) report(*read);
  }
  if (std::ferror(input))
    throw std::runtime_error(fmt::format(
        "cannot read {}: {}", file.empty() ? "standard input" : file.string(), std::strerror(errno)));
  if (const auto read = reader->Finish()) report(*read);
  return rejected ? kExitNotGreen : kExitGreen;
}

}  // namespace

void RegisterFrame(CLI::App& program, CommandLine& line) {
  CLI::App* command = program.add_subcommand("frame", "Encode and decode frames of the serial line");
  command->require_subcommand(1);
  const auto options = std::make_shared<FrameOptions>();
  const auto add_protocol = [&](CLI::App& part, const char* what) {
    part.add_option("--protocol", options->protocol, what);
  };

  const auto hex = std::make_shared<std::string>();
  CLI::App* encode =
      command->add_subcommand("encode", "Print the frame that carries a payload, in hexadecimal");
  encode->add_option("HEX", *hex, "The payload in hexadecimal")->required();
  add_protocol(*encode, "Whose framing: a built-in protocol or a protocol file (default: paper)");
  SetAction(*encode, line, [hex, options] { return FrameEncodeCommand(*hex, *options); });

  const auto file = std::make_shared<std::filesystem::path>();
  CLI::App* decode =
      command->add_subcommand("decode", "Decode raw bytes: one JSON line per frame or rejection");
  decode->add_option("FILE", *file, "Raw bytes (default: standard input)");
  add_protocol(*decode, "Also print the messages, of a built-in protocol or a protocol file");
  SetAction(*decode, line, [file, options] { return FrameDecodeCommand(*file, *options); });
}

}  // namespace tiltproof::harness
