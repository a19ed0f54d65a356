#include "harness/scenario/protocol_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/scenario/diagnostic.h"
#include "harness/scenario/reader.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using link::Direction;
using link::MessageKind;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::string_view kQuad = R"(protocol: quad
control_period_ms: 4
framing: {type: length_prefixed, sync: [0xAA, 85], length: u8, check: crc16_ibm_3740}
exchange: stream
byte_order: big
id: {type: u16, byte_order: little}
start: {first: motors}
frames: {world: ned, body: frd}
messages:
  - name: imu
    id: 260
    from: server
    period_ms: 4
    fields:
      - {signal: sequence, type: u8}
      - {signal: wx_rad_s, type: i16, scale: 0.001, min: -30, max: 30}
      - {signal: roll_rad, type: f64, byte_order: little}
  - {name: baro, id: 7, from: server, period_ms: 40, fields: [{signal: z_m, type: i32, scale: 0.01}]}
  - {name: motors, id: 3, from: client, fields: [{signal: f_r_n, type: u8, scale: 0.00390625, as: share}]}
  - {name: reference, line: reference, from: server, fields: [{signal: x_m, type: f32}]}
)";

// The file, with a change.
std::string Quad(std::string_view part = {}, std::string_view by = {}) {
  std::string text(kQuad);
  const auto at = text.find(part);
  EXPECT_NE(at, std::string::npos) << part;
  return text.replace(at, part.size(), by);
}

std::vector<std::string> ErrorsOf(const std::string& text) {
  try {
    ParseProtocolFile(text, "p.yaml");
  } catch (const ScenarioError& error) {
    std::vector<std::string> lines;
    for (const Diagnostic& diagnostic : error.diagnostics()) lines.push_back(ToString(diagnostic).substr(7));
    return lines;
  }
  return {};
}

TEST(ProtocolFileTest, ReadsEveryKey) {
  const auto protocol = ParseProtocolFile(Quad(), "p.yaml").protocol;
  EXPECT_EQ(protocol->name, "quad");
  EXPECT_EQ(protocol->control_period_ns, 4 * kNsPerMs);
  EXPECT_EQ(protocol->world, link::WorldAxes::kNed);
  EXPECT_EQ(protocol->body, link::BodyAxes::kFrd);
  EXPECT_FALSE(protocol->answers_before_start);
  ASSERT_EQ(protocol->messages.size(), 4U);
  const link::MessageType& imu = protocol->messages[0];
  EXPECT_EQ(imu.kind, MessageKind::kStreamed);
  EXPECT_EQ(imu.direction, Direction::kToClient);
  EXPECT_EQ(imu.period_ns, 4 * kNsPerMs);
  EXPECT_EQ(imu.payload_bytes, 2U + 1 + 2 + 8);
  EXPECT_EQ(imu.fields[0].content, link::FieldContent::kSequence);
  EXPECT_EQ(imu.fields[1].order, link::ByteOrder::kBig);
  EXPECT_EQ(imu.fields[2].order, link::ByteOrder::kLittle);
  EXPECT_EQ(imu.fields[2].max, 100.0);  // a plausible angle
  const link::MessageType& motors = protocol->messages[2];
  EXPECT_EQ(motors.kind, MessageKind::kActuators);
  EXPECT_TRUE(motors.starts);
  EXPECT_EQ(motors.fields[0].as, link::ThrustUnit::kShare);
  EXPECT_EQ(motors.fields[0].max, 255.0 / 256);
  EXPECT_EQ(protocol->messages[1].fields[0].min, -0.01 * 2147483648.0);
  EXPECT_EQ(protocol->Find(MessageKind::kReference)->payload_bytes, 4U);
}

// By hand: 1.234 rad/s is 1234 = 0x04D2, high byte first; the id 260 = 0x0104 has its low byte first. The check is the
// remainder that RevEng's parameters of CRC-16/IBM-3740 give, computed bit by bit.
TEST(ProtocolFileTest, AFrameHasTheBytesOfTheFile) {
  const auto protocol = ParseProtocolFile(Quad(), "p.yaml").protocol;
  const std::vector<double> values = {9, 1.234, -2};
  const auto payload = protocol->Encode(protocol->messages[0], values);
  std::vector<std::uint8_t> expected = {0xAA, 0x55, 13,  // sync, length
                                        0x04, 0x01, 9,  0x04, 0xD2, 0, 0, 0, 0, 0, 0, 0, 0xC0};
  std::uint16_t crc = 0xFFFF;
  for (std::size_t i = 3; i < expected.size(); ++i)
    for (int bit = 7; bit >= 0; --bit) {
      const bool carries = ((crc >> 15) ^ (expected[i] >> bit & 1)) != 0;
      crc = static_cast<std::uint16_t>(crc << 1 ^ (carries ? 0x1021 : 0));
    }
  expected.push_back(static_cast<std::uint8_t>(crc >> 8));
  expected.push_back(static_cast<std::uint8_t>(crc & 0xFF));
  EXPECT_EQ(protocol->framing->Encode(payload.span()), expected);
}

TEST(ProtocolFileTest, ErrorsHaveTheirPlaces) {
  struct Case {
    std::string_view part, by, error;
  };
  const Case cases[] = {
      {"control_period_ms", "control_periode_ms",
       "2:1: unknown key 'control_periode_ms'; did you mean 'control_period_ms'?"},
      {"control_period_ms: 4", "control_period_ms: 4.0000001",
       "2:20: control_period_ms: 4.0000001 ms is not a whole number of nanoseconds"},
      {"crc16_ibm_3740", "crc16", "3:71: check: unknown value 'crc16'; did you mean 'crc16_ibm_3740'?"},
      {"[0xAA, 85]", "0xAA", "3:40: sync: expected a list of bytes: [0xAA]"},
      {"[0xAA, 85]", "[]", "3:40: sync: expected 1 to 4 bytes, found 0"},
      {"85]", "256]", "3:47: sync: expected a byte such as 170 or 0xAA, found 256"},
      {"exchange: stream", "exchange: request_reply",
       "4:11: exchange: request_reply needs a message from the client with a 'reply'"},
      {"first: motors", "message: motor",
       "7:18: message: the client has no message 'motor'; did you mean 'motors'?"},
      {"first: motors", "message: motors",
       "7:18: message: 'motors' alone carries inputs of the vehicle, and a `message` comes once: write "
       "`first: "
       "motors`"},
      {"first: motors", "first: motors, repeated: boot",
       "7:34: repeated: 'motors' comes again in every flight: only a `message` of its own can mean a boot"},
      {"id: 260", "id: 65536",
       "11:9: id: 65536 is not a number of type u16, which ids have here (key 'id' of the file)"},
      {"id: 7", "id: 260", "18:22: id: 260 is that of 'imu' on line 11 already"},
      {"baro, id: 7", "baro",
       "18:12: name: 'baro' needs an id, because 'imu' (line 10) travels in the same direction"},
      {"name: baro", "name: imu", "18:12: name: 'imu' is taken already on line 10"},
      {"period_ms: 40, ", "",
       "18:12: name: nothing makes the server send 'baro': give it a period_ms, or name it as a 'reply'"},
      {"min: -30, max", "min: -33, max",
       "16:58: min: -33 is -33000 on the line (scale 0.001), and i16 holds -32768 to 32767"},
      {"min: -30, max: 30", "min: 3, max: -3", "16:58: min: min 3 is above max -3"},
      {"scale: 0.001", "scale: 0", "16:46: scale: 0 is out of range; must be from 1e-300 to 1e+300"},
      {"signal: roll_rad", "signal: wx_rad_s", "17:18: signal: 'wx_rad_s' is in this message already"},
      {"sequence, type: u8", "sequence, type: i8",
       "15:34: type: 'sequence' is a count that wraps: it needs u8, u16 or u32"},
      {"from: client, ", "from: client, reply: baro, ",
       "19:48: reply: a stream has no requests: leave it out, or write `exchange: request_reply`"},
      {"line: reference, from: server", "line: reference, from: client",
       "20:29: line: the client only listens to the reference line: write `from: server`"},
      {"name: motors, id: 3, from: client", "name: motors, id: 3, from: server, period_ms: 4",
       "10:3: messages: the client has no actuator message: one with the vehicle's inputs as fields"},
  };
  for (const Case& c : cases) EXPECT_THAT(ErrorsOf(Quad(c.part, c.by)), Contains(HasSubstr(c.error))) << c.by;
}

TEST(ProtocolFileTest, ATimeDoesNotWrapWithinTwoPeriods) {
  const auto errors = [](std::string_view type, std::string_view period_ms) {
    std::string text =
        Quad("{signal: sequence, type: u8}", "{signal: time_us, type: " + std::string(type) + "}");
    const std::string before = "period_ms: 4\n    fields";
    return ErrorsOf(text.replace(text.find(before), before.size(),
                                 "period_ms: " + std::string(period_ms) + "\n    fields"));
  };
  // Half of 256 us, and of 65,536 us.
  EXPECT_THAT(errors("u8", "4"),
              Contains(HasSubstr("type: a time of type u8 wraps every 256 us, which is less than two periods "
                                 "of 4000 us; write u32")));
  EXPECT_THAT(errors("u16", "32"), ElementsAre());
  EXPECT_THAT(errors("u16", "36"), Contains(HasSubstr("type: a time of type u16 wraps every 65536 us")));
}

TEST(ProtocolFileTest, ARequestIsNoStartOfItsOwn) {
  std::string text = Quad("exchange: stream", "exchange: request_reply");
  const std::string before = "start: {first: motors}";
  text.replace(text.find(before), before.size(), "start: {message: ask}");
  text +=
      "  - {name: ask, id: 9, from: client, reply: state}\n"
      "  - {name: state, id: 10, from: server, fields: [{signal: y_m, type: f32}]}\n";
  EXPECT_THAT(
      ErrorsOf(text),
      Contains(HasSubstr("message: 'ask' comes again in every period, because it has a 'reply': write "
                         "`first: ask`")));
}

// A sender at the end of the range sends the nearest number, which may lie beyond: 61000 x 0.0001 is 6.1000000000000005
// as a double, and the nearest f32 of 0.1 is 0.100000001.
TEST(ProtocolFileTest, BothEndsOfARangeArePlausible) {
  const auto status = [](const std::string& field, double value) {
    const auto protocol =
        ParseProtocolFile(Quad("{signal: z_m, type: i32, scale: 0.01}", field), "p.yaml").protocol;
    const std::vector<double> values = {value};
    link::Message message;
    return protocol->Decode(Direction::kToClient, protocol->Encode(protocol->messages[1], values).span(),
                            message);
  };
  const std::string scaled = "{signal: z_m, type: i32, scale: 0.0001, min: -6.1, max: 6.1}";
  EXPECT_EQ(status(scaled, 6.1), link::MessageStatus::kOk);
  EXPECT_EQ(status(scaled, -6.1), link::MessageStatus::kOk);
  EXPECT_EQ(status(scaled, 6.1001), link::MessageStatus::kOutOfRange);
  const std::string single = "{signal: z_m, type: f32, min: -0.1, max: 0.1}";
  EXPECT_EQ(status(single, 0.1), link::MessageStatus::kOk);
  EXPECT_EQ(status(single, -0.1), link::MessageStatus::kOk);
  EXPECT_EQ(status(single, 0.10000002), link::MessageStatus::kOutOfRange);
}

TEST(ProtocolFileTest, APayloadFitsItsLengthField) {
  std::string fields;
  for (int i = 0; i < 64; ++i)
    fields += (i == 0 ? "" : ", ") + std::string("{signal: s") + std::to_string(i) + ", type: f32}";
  const std::string text = Quad("{signal: z_m, type: i32, scale: 0.01}", fields);
  EXPECT_THAT(
      ErrorsOf(text),
      ElementsAre(
          "18:12: name: the payload of 'baro' has 258 bytes, more than a length of type u8 can count; "
          "write `length: u16`; the longest has 255"));
}

// A protocol is its file: made from its own description it has the same bytes and ranges.
TEST(ProtocolFileTest, AResolvedScenarioHoldsTheProtocol) {
  const fs::path folder = fs::path(testing::TempDir()) / "tiltproof_protocol_file";
  fs::remove_all(folder);
  fs::create_directories(folder / "models");
  std::ofstream(folder / "models/tiltrotor.sdf") << "<sdf/>";
  std::ofstream(folder / "quad.yaml") << Quad();
  std::ofstream(folder / "s.yaml") << "name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0, 2]}\n"
                                      "link: {protocol: quad.yaml}\n"
                                      "faults: [{id: a, type: frame.drop, target: to_client, message: baro, "
                                      "parameters: {probability: 1}}]\n";
  ReadOptions options;
  options.models_folder = folder / "models";
  const Scenario first = ReadScenario(folder / "s.yaml", options);
  EXPECT_EQ(first.faults.at(0).message, "baro");
  fs::remove(folder / "quad.yaml");
  const std::string resolved = WriteResolved(first);
  const Scenario again = ParseScenario(resolved, "resolved.yaml", options);
  EXPECT_EQ(WriteResolved(again), resolved);
  EXPECT_TRUE(SameOnTheLine(*first.link.protocol, *again.link.protocol));
  std::mt19937_64 random(3);
  for (std::size_t i = 0; i < first.link.protocol->messages.size(); ++i) {
    const link::MessageType &a = first.link.protocol->messages[i], &b = again.link.protocol->messages[i];
    EXPECT_EQ(a.name, b.name);
    ASSERT_EQ(a.fields.size(), b.fields.size());
    for (std::size_t k = 0; k < a.fields.size(); ++k) {
      EXPECT_EQ(a.fields[k].min, b.fields[k].min);
      EXPECT_EQ(a.fields[k].max, b.fields[k].max);
    }
    for (int n = 0; n < 100; ++n) {
      std::vector<double> values;
      for (const auto& field : a.fields)
        values.push_back(field.min + (field.max - field.min) * (static_cast<double>(random() % 1000) / 999));
      EXPECT_EQ(first.link.protocol->framing->Encode(first.link.protocol->Encode(a, values).span()),
                again.link.protocol->framing->Encode(again.link.protocol->Encode(b, values).span()));
    }
  }
  fs::remove_all(folder);
}

TEST(ProtocolFileTest, TheShippedProtocolsAreTheirOwnDescription) {
  for (const auto& protocol : ShippedProtocols()) {
    const ProtocolSpec spec = SpecOf(*protocol);
    YamlNode mapping;  // only for the places of errors
    mapping.kind = YamlNode::Kind::kMapping;
    YamlNode list;
    list.kind = YamlNode::Kind::kSequence;
    list.items.resize(spec.messages.size());
    mapping.entries.push_back({"messages", {}, list});
    std::vector<YamlProblem> problems;
    for (std::size_t i = 0; i < spec.messages.size(); ++i) {
      YamlNode fields;
      fields.kind = YamlNode::Kind::kSequence;
      fields.items.resize(spec.messages[i].fields.size());
      auto& message = mapping.entries.back().value.items[i];
      message.kind = YamlNode::Kind::kMapping;
      message.entries.push_back({"fields", {}, fields});
    }
    const auto again = MakeProtocol(spec, mapping, problems);
    ASSERT_NE(again, nullptr) << protocol->name;
    EXPECT_TRUE(SameOnTheLine(*protocol, *again));
    EXPECT_EQ(DialectOf(*again), protocol->name);
  }
}

TEST(ProtocolFileTest, AProtocolWithTheBytesOfAShippedOneIsThatDialect) {
  link::Protocol copy = *FindProtocol("paper");
  copy.name = "mine";
  copy.messages[3].fields[0].max = 5;
  EXPECT_EQ(DialectOf(copy), "paper");
  copy.messages[3].fields[0].scale = 2;
  EXPECT_EQ(DialectOf(copy), "mine");
  copy = *FindProtocol("paper");
  copy.framing = link::MakeHdlcFraming(link::CheckKind::kCrc16IbmSdlc);
  EXPECT_EQ(DialectOf(copy), "paper") << "its own name";
  EXPECT_FALSE(SameOnTheLine(copy, *FindProtocol("paper")));
}

}  // namespace
}  // namespace tiltproof::harness
