// Protocol files: a protocol of a serial line (link/protocol.h) as YAML.
//
//   const std::shared_ptr<const link::Protocol> quad = ReadProtocolFile("quad.yaml");  // throws ScenarioError
//
// docs/protocol.md describes the file. The shipped protocols are such files, too: link/protocols/*.yaml.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/key_visitor.h"
#include "harness/scenario/yaml_tree.h"
#include "link/protocol.h"

namespace tiltproof::harness {

enum class FramingType : std::uint8_t { kHdlc, kCobs, kLengthPrefixed };
std::string_view Name(FramingType type);  // as Framing::name()
enum class ExchangeType : std::uint8_t { kRequestReply, kStream };
std::string_view Name(ExchangeType type);
enum class RepeatedStart : std::uint8_t { kIgnored, kBoot };
std::string_view Name(RepeatedStart repeated);
enum class LineEnd : std::uint8_t { kClientEnd, kServerEnd };
std::string_view Name(LineEnd end);
enum class LineName : std::uint8_t { kMain, kReference };
std::string_view Name(LineName line);

// The keys of a protocol file as written.
struct FieldSpec {
  std::string signal;
  link::NumberType type = link::NumberType::kF32;
  double scale = 1.0;
  std::optional<double> min, max;
  link::ThrustUnit as = link::ThrustUnit::kNewton;
  std::optional<link::ByteOrder> order;
};
struct MessageSpec {
  std::string name;
  std::optional<double> id;
  LineEnd from = LineEnd::kClientEnd;
  LineName line = LineName::kMain;
  std::string reply;
  std::optional<double> period_ms;
  std::vector<FieldSpec> fields;
};
struct ProtocolSpec {
  std::string name;
  double control_period_ms = 0;
  FramingType framing = FramingType::kHdlc;
  link::CheckKind check = link::CheckKind::kCrc16IbmSdlc;
  std::vector<std::uint8_t> sync;
  link::NumberType length = link::NumberType::kU8;
  ExchangeType exchange = ExchangeType::kRequestReply;
  link::ByteOrder order = link::ByteOrder::kLittle;
  link::NumberType id_type = link::NumberType::kU8;
  std::optional<link::ByteOrder> id_order;
  std::string start_message, first_message;  // one of them
  RepeatedStart repeated_start = RepeatedStart::kIgnored;
  bool answers_before_start = false;
  link::WorldAxes world = link::WorldAxes::kEnu;
  link::BodyAxes body = link::BodyAxes::kFlu;
  std::vector<MessageSpec> messages;
};

void DescribeProtocol(KeyVisitor& visitor, ProtocolSpec& spec);

// The file of a protocol: MakeProtocol() makes an equal one from it.
ProtocolSpec SpecOf(const link::Protocol& protocol);

// The protocol of a file whose tree is `mapping`. Null when `problems`, to which this function appends, is not empty.
std::shared_ptr<const link::Protocol> MakeProtocol(const ProtocolSpec& spec, const YamlNode& mapping,
                                                   std::vector<YamlProblem>& problems);

// A protocol, and the tree of its file: for the place of a field that does not suit a vehicle.
struct ProtocolFile {
  std::shared_ptr<const link::Protocol> protocol;
  YamlNode root;
};
// Throws ScenarioError. `file` names the text in messages.
ProtocolFile ParseProtocolFile(const std::string& text, const std::filesystem::path& file);

// The place of a field's `signal` in a protocol's tree; none where there is no such message or field.
std::optional<YamlMark> PlaceOfField(const YamlNode& protocol, std::string_view message,
                                     std::string_view signal);

// Throw ScenarioError, also for a protocol that has the name of a shipped one.
ProtocolFile LoadProtocolFile(const std::filesystem::path& file);
std::shared_ptr<const link::Protocol> ReadProtocolFile(const std::filesystem::path& file);

// The name by which the shipped firmware knows the protocol: that of the shipped one that has the same bytes on the line,
// or the protocol's own.
std::string DialectOf(const link::Protocol& protocol);
// The reason that a user's protocol may not have this name; empty when it may.
std::string TakenProtocolName(std::string_view name);

}  // namespace tiltproof::harness
