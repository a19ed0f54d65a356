#include "firmware/messages.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "link/frame.h"
#include "tests/fuzz/differential.h"
#include "tests/link/sensor_frame.h"

namespace tiltproof::link {
namespace {

using tiltproof::testing::Bytes;
using tiltproof::testing::FromHex;
using tiltproof::testing::Hex;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

constexpr Actuators kActuators = {10.2751F, 10.2799F, -0.015625F, 0.5F};
constexpr char kActuatorsHex[] = "cf662441787a2441000080bc0000003f";
constexpr Reference kReference = {2.0F, 0.5F, 1.25F, -3.0F, 0.1F, 0.0F, -0.25F};

Bytes ToBytes(const MessageBytes& message) { return Bytes(message.span().begin(), message.span().end()); }

MessageStatus DecodeStatus(Dialect dialect, const Bytes& payload) {
  ClientMessage message;
  return DecodeClientMessage(dialect, payload, message);
}

Bytes FrameOf(const MessageBytes& message) {
  Bytes wire(FrameBytesMax(message.size));
  const EncodedFrame frame = EncodeFrame(message.span(), wire);
  return Bytes(frame.bytes.begin(), frame.bytes.end());
}

// Each id in both dialects: bytes, and what they say. The frames are worked out by hand.
struct Golden {
  const char* name;
  Dialect dialect;
  MessageBytes encoded;
  std::string frame_hex;
  MessageKind kind;
  ClientMessage message;
};

// Names the test in listings, in place of its bytes.
void PrintTo(const Golden& golden, std::ostream* out) { *out << golden.name; }

class GoldenMessage : public ::testing::TestWithParam<Golden> {};

TEST_P(GoldenMessage, Encodes) { EXPECT_EQ(Hex(FrameOf(GetParam().encoded)), GetParam().frame_hex); }

TEST_P(GoldenMessage, Decodes) {
  const auto events = tiltproof::testing::Decode(FromHex(GetParam().frame_hex));
  ASSERT_EQ(events.size(), 1U);
  ClientMessage message;
  ASSERT_EQ(DecodeClientMessage(GetParam().dialect, events[0].payload, message), MessageStatus::kOk);
  EXPECT_EQ(message, GetParam().message);
  EXPECT_EQ(ClassifyClientPayload(GetParam().dialect, events[0].payload), GetParam().kind);
}

const ClientMessage kStart = {.start = true, .actuators = {}};
const ClientMessage kRead = {.read_sensors = true, .actuators = {}};
const ClientMessage kAct = {.has_actuators = true, .actuators = kActuators};
const ClientMessage kStartAndAct = {.start = true, .has_actuators = true, .actuators = kActuators};

INSTANTIATE_TEST_SUITE_P(
    , GoldenMessage,
    ::testing::Values(
        Golden{"PaperStart", Dialect::kPaper, EncodeStart(Dialect::kPaper, kActuators), "7e0000803fbf407e",
               MessageKind::kStart, kStart},
        Golden{"PaperRead", Dialect::kPaper, EncodeReadSensors(Dialect::kPaper), "7e0000004040407e",
               MessageKind::kRequest, kRead},
        Golden{"PaperActuators", Dialect::kPaper, EncodeActuators(Dialect::kPaper, kActuators),
               "7e00004040cf662441787a2441000080bc0000003ff09f7e", MessageKind::kActuators, kAct},
        Golden{"ProvantStart", Dialect::kProvant, EncodeStart(Dialect::kProvant, kActuators),
               "7e00004040cf662441787a2441000080bc0000003ff09f7e", MessageKind::kStart, kStartAndAct},
        Golden{"ProvantRead", Dialect::kProvant, EncodeReadSensors(Dialect::kProvant), "7e0000803fbf407e",
               MessageKind::kRequest, kRead},
        Golden{"ProvantActuators", Dialect::kProvant, EncodeActuators(Dialect::kProvant, kActuators),
               "7e00000000cf662441787a2441000080bc0000003f70d67e", MessageKind::kActuators, kAct}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(Messages, SensorsOnTheWire) {
  const MessageBytes message = EncodeSensors(tiltproof::testing::SampleSensors());
  EXPECT_EQ(Hex(message.span()), tiltproof::testing::kSampleSensorsHex);
  EXPECT_EQ(Hex(FrameOf(message)), tiltproof::testing::kSampleFrameHex);
  Sensors sensors;
  ASSERT_EQ(DecodeSensors(message.span(), sensors), MessageStatus::kOk);
  EXPECT_EQ(sensors, tiltproof::testing::SampleSensors());
}

TEST(Messages, ReferenceOnTheWire) {
  const MessageBytes message = EncodeReference(kReference);
  EXPECT_EQ(Hex(FrameOf(message)), "7e000000400000003f0000a03f000040c0cdcccc3d00000000000080be449b7e");
  Reference reference;
  ASSERT_EQ(DecodeReference(message.span(), reference), MessageStatus::kOk);
  EXPECT_EQ(reference, kReference);
}

// The order of the 16 floats is the paper's, told here without the field table.
TEST(Messages, SensorOrder) {
  const Sensors sensors = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  const Bytes bytes = ToBytes(EncodeSensors(sensors));
  Sensors decoded;
  ASSERT_EQ(ParseSensors(bytes, decoded), MessageStatus::kOk);
  EXPECT_EQ(decoded.x_m, 1);
  EXPECT_EQ(decoded.yaw_rad, 6);
  EXPECT_EQ(decoded.alpha_r_rad, 7);
  EXPECT_EQ(decoded.vx_m_s, 9);
  EXPECT_EQ(decoded.wx_rad_s, 12);
  EXPECT_EQ(decoded.alpha_l_rad_s, 16);
  EXPECT_EQ(Hex(std::span(bytes).subspan(60)), "00008041");  // 16.0f, last
}

// --- What must be refused.

TEST(ClientMessage, EveryLengthButTheRightOne) {
  for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant}) {
    for (const MessageBytes& right : {EncodeStart(dialect, kActuators), EncodeReadSensors(dialect),
                                      EncodeActuators(dialect, kActuators)}) {
      for (std::size_t length = 0; length <= kPayloadBytesMax; ++length) {
        Bytes payload = ToBytes(right);
        payload.resize(length);
        const bool exact = length == right.size;
        ASSERT_EQ(DecodeStatus(dialect, payload), exact ? MessageStatus::kOk : MessageStatus::kBadLength)
            << length;
        ASSERT_EQ(ClassifyClientPayload(dialect, payload) != MessageKind::kUnknown, exact);
      }
    }
  }
}

// One bit away from an id is no id, but for 0.0, 2.0 and 3.0, which are neighbours.
TEST(ClientMessage, IdsAreExactBitPatterns) {
  int unknown_count = 0;
  for (const float id : {1.0F, 2.0F, 3.0F, 0.0F}) {
    for (int bit = 0; bit < 32; ++bit) {
      const std::uint32_t bits = std::bit_cast<std::uint32_t>(id) ^ std::uint32_t{1} << bit;
      if (bits == 0 || bits == 0x40000000 || bits == 0x40400000) continue;
      Bytes payload;
      for (int shift = 0; shift < 32; shift += 8) payload.push_back(static_cast<std::uint8_t>(bits >> shift));
      for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant}) {
        ASSERT_EQ(DecodeStatus(dialect, payload), MessageStatus::kUnknownId) << Hex(payload);
        ++unknown_count;
      }
    }
  }
  EXPECT_EQ(unknown_count, 2 * (4 * 32 - 4));  // 0 <-> 2 and 2 <-> 3
}

TEST(ClientMessage, IdsOfTheOtherDialect) {
  EXPECT_EQ(DecodeStatus(Dialect::kPaper, FromHex("00000000" + std::string(kActuatorsHex))),
            MessageStatus::kUnknownId);
  EXPECT_EQ(DecodeStatus(Dialect::kProvant, FromHex("00000040")), MessageStatus::kUnknownId);
  EXPECT_EQ(DecodeStatus(Dialect::kPaper, FromHex("01000000")),
            MessageStatus::kUnknownId);  // an integer is no id
}

// The authors' server applies a thrust of NaN.
TEST(ClientMessage, EveryActuatorMustBeFiniteAndInRange) {
  for (std::size_t i = 0; i < kActuatorCount; ++i) {
    const float limit = i < 2 ? kForceMax_n : kTorqueMax_nm;
    const auto status = [&](float value) {
      Actuators actuators = kActuators;
      actuators.*kActuatorFields[i].in_float = value;
      const MessageStatus paper =
          DecodeStatus(Dialect::kPaper, ToBytes(EncodeActuators(Dialect::kPaper, actuators)));
      EXPECT_EQ(DecodeStatus(Dialect::kProvant, ToBytes(EncodeActuators(Dialect::kProvant, actuators))),
                paper);
      EXPECT_EQ(DecodeStatus(Dialect::kProvant, ToBytes(EncodeStart(Dialect::kProvant, actuators))), paper);
      return paper;
    };
    EXPECT_EQ(status(kNaN), MessageStatus::kNotFinite);
    EXPECT_EQ(status(-kNaN), MessageStatus::kNotFinite);
    EXPECT_EQ(status(kInfinity), MessageStatus::kNotFinite);
    EXPECT_EQ(status(-kInfinity), MessageStatus::kNotFinite);
    EXPECT_EQ(status(std::nextafter(limit, kInfinity)), MessageStatus::kOutOfRange);
    EXPECT_EQ(status(std::nextafter(-limit, -kInfinity)), MessageStatus::kOutOfRange);
    EXPECT_EQ(status(limit), MessageStatus::kOk);
    EXPECT_EQ(status(-limit), MessageStatus::kOk);
    EXPECT_EQ(status(-0.0F), MessageStatus::kOk);
    EXPECT_EQ(status(std::numeric_limits<float>::denorm_min()), MessageStatus::kOk);
  }
}

TEST(SensorsMessage, EverySignalMustBeFiniteAndInRange) {
  constexpr std::array<float, kSensorCount> kLimits = {1e4F, 1e4F, 1e4F, 100,  100,  100,  100,  100,
                                                       1e3F, 1e3F, 1e3F, 1e3F, 1e3F, 1e3F, 1e3F, 1e3F};
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    const auto status = [&](float value) {
      Sensors sensors = tiltproof::testing::SampleSensors();
      sensors.*kSensorFields[i].in_float = value;
      Sensors decoded;
      return DecodeSensors(EncodeSensors(sensors).span(), decoded);
    };
    EXPECT_EQ(status(kNaN), MessageStatus::kNotFinite) << kSensorFields[i].column;
    EXPECT_EQ(status(-kInfinity), MessageStatus::kNotFinite) << kSensorFields[i].column;
    EXPECT_EQ(status(kLimits[i]), MessageStatus::kOk) << kSensorFields[i].column;
    EXPECT_EQ(status(std::nextafter(-kLimits[i], -kInfinity)), MessageStatus::kOutOfRange)
        << kSensorFields[i].column;
  }
}

TEST(ReferenceMessage, EverySignalMustBeFiniteAndInRange) {
  constexpr std::array<float, kReferenceCount> kLimits = {1e4F, 1e4F, 1e4F, 100, 1e3F, 1e3F, 1e3F};
  for (std::size_t i = 0; i < kReferenceCount; ++i) {
    const auto status = [&](float value) {
      Reference reference = kReference;
      reference.*kReferenceFields[i].in_float = value;
      Reference decoded;
      return DecodeReference(EncodeReference(reference).span(), decoded);
    };
    EXPECT_EQ(status(kNaN), MessageStatus::kNotFinite) << kReferenceFields[i].column;
    EXPECT_EQ(status(kInfinity), MessageStatus::kNotFinite) << kReferenceFields[i].column;
    EXPECT_EQ(status(-kLimits[i]), MessageStatus::kOk) << kReferenceFields[i].column;
    EXPECT_EQ(status(std::nextafter(kLimits[i], kInfinity)), MessageStatus::kOutOfRange)
        << kReferenceFields[i].column;
  }
}

TEST(Messages, EveryLengthButTheRightOne) {
  for (std::size_t length = 0; length <= kPayloadBytesMax; ++length) {
    const Bytes payload(length);
    Sensors sensors;
    Reference reference;
    ASSERT_EQ(DecodeSensors(payload, sensors) == MessageStatus::kOk, length == 64);
    ASSERT_EQ(ParseSensors(payload, sensors) == MessageStatus::kOk, length == 64);
    ASSERT_EQ(DecodeReference(payload, reference) == MessageStatus::kOk, length == 28);
    if (length != 64) {
      ASSERT_EQ(DecodeSensors(payload, sensors), MessageStatus::kBadLength);
      ASSERT_EQ(ParseSensors(payload, sensors), MessageStatus::kBadLength);
    }
    if (length != 28) {
      ASSERT_EQ(DecodeReference(payload, reference), MessageStatus::kBadLength);
    }
  }
}

TEST(Messages, SingleRefusedSensorsBecomeNotANumber) {
  Sensors sensors;
  for (const auto& field : kSensorFields) sensors.*field.in_float = 0.5F;
  for (const auto& refused : kSensorFields) {
    for (const float value : {kNaN, kInfinity, -2e4F}) {
      Sensors damaged = sensors;
      damaged.*refused.in_float = value;
      Sensors decoded;
      ASSERT_EQ(DecodeSensorsPartly(EncodeSensors(damaged).span(), 1, decoded), MessageStatus::kOk);
      for (const auto& field : kSensorFields) {
        const float expected = field.column == refused.column ? kNaN : 0.5F;
        EXPECT_TRUE(std::isnan(expected) ? std::isnan(decoded.*field.in_float)
                                         : decoded.*field.in_float == expected);
      }
      EXPECT_EQ(DecodeSensorsPartly(EncodeSensors(damaged).span(), 0, decoded), MessageStatus::kNotFinite);
    }
  }
  Sensors decoded;
  EXPECT_EQ(DecodeSensorsPartly(EncodeReference({}).span(), 16, decoded), MessageStatus::kBadLength);
}

TEST(Messages, NotFiniteGoesBeforeOutOfRange) {
  Sensors sensors = tiltproof::testing::SampleSensors();
  sensors.x_m = 1e30F;
  sensors.alpha_l_rad_s = kNaN;
  Sensors decoded;
  EXPECT_EQ(DecodeSensors(EncodeSensors(sensors).span(), decoded), MessageStatus::kNotFinite);
}

TEST(Messages, ARefusalLeavesTheOutputAlone) {
  const Sensors before = tiltproof::testing::SampleSensors();
  Sensors bad = before;
  bad.vy_m_s = kNaN;
  bad.x_m = 7;
  Sensors sensors = before;
  EXPECT_NE(DecodeSensors(EncodeSensors(bad).span(), sensors), MessageStatus::kOk);
  EXPECT_NE(ParseSensors(Bytes(63), sensors), MessageStatus::kOk);
  EXPECT_EQ(sensors, before);

  Reference reference = kReference;
  EXPECT_NE(DecodeReference(Bytes(28, 0xFF), reference), MessageStatus::kOk);
  EXPECT_EQ(reference, kReference);

  ClientMessage message = kStartAndAct;
  EXPECT_NE(DecodeClientMessage(Dialect::kPaper, FromHex("00004040" + std::string(32, 'f')), message),
            MessageStatus::kOk);
  EXPECT_EQ(message, kStartAndAct);
}

// A reply that comes back to the server is nothing a client could have asked.
TEST(Messages, AnEchoedReplyIsNoRequest) {
  const Bytes reply = FromHex(tiltproof::testing::kSampleSensorsHex);
  EXPECT_EQ(DecodeStatus(Dialect::kPaper, reply),
            MessageStatus::kBadLength);  // x = 2.0 reads as the id of a request
  EXPECT_EQ(DecodeStatus(Dialect::kProvant, reply), MessageStatus::kUnknownId);
}

// Trusting the checksum means trusting any bits.
TEST(ParseSensors, KeepsEveryBitPattern) {
  const Bytes payload(64, 0xFF);
  Sensors sensors;
  ASSERT_EQ(ParseSensors(payload, sensors), MessageStatus::kOk);
  EXPECT_TRUE(std::isnan(sensors.x_m));
  EXPECT_EQ(ToBytes(EncodeSensors(sensors)), payload);
}

// A frame that is valid and says nothing: an abort in the authors' receiver.
TEST(Messages, ValidFrameOfWrongLength) {
  const auto events = tiltproof::testing::Decode(FromHex("7e0000007e"));
  ASSERT_EQ(events.size(), 1U);
  ASSERT_EQ(events[0].status, FrameStatus::kOk);
  EXPECT_EQ(DecodeStatus(Dialect::kPaper, events[0].payload), MessageStatus::kBadLength);
  Sensors sensors;
  EXPECT_EQ(DecodeSensors(events[0].payload, sensors), MessageStatus::kBadLength);
}

RC_GTEST_PROP(MessagesProperty, SensorsSurviveTheRoundTrip, ()) {
  Sensors sensors;
  for (const auto& field : kSensorFields)
    sensors.*field.in_float = static_cast<float>(*rc::gen::inRange(-99999, 100000)) * 1e-3F;
  Sensors decoded;
  RC_ASSERT(DecodeSensors(EncodeSensors(sensors).span(), decoded) == MessageStatus::kOk);
  RC_ASSERT(decoded == sensors);
}

RC_GTEST_PROP(MessagesProperty, AcceptedBytesAreTheEncodingOfWhatTheySay,
              (const std::vector<std::uint8_t>& tail)) {
  Bytes payload = FromHex(*rc::gen::element<std::string>("0000803f", "00000040", "00004040", "00000000", ""));
  payload.insert(payload.end(), tail.begin(), tail.end());
  if (*rc::gen::arbitrary<bool>()) payload.resize(*rc::gen::element<std::size_t>(4, 20));
  ClientMessage message;
  if (DecodeClientMessage(Dialect::kPaper, payload, message) != MessageStatus::kOk) return;
  const MessageBytes again = message.start          ? EncodeStart(Dialect::kPaper, {})
                             : message.read_sensors ? EncodeReadSensors(Dialect::kPaper)
                                                    : EncodeActuators(Dialect::kPaper, message.actuators);
  RC_ASSERT(ToBytes(again) == payload);
}

TEST(Names, AreThoseOfScenarioFilesAndLogs) {
  EXPECT_EQ(Name(Dialect::kPaper), "paper");
  EXPECT_EQ(Name(Dialect::kProvant), "provant");
  EXPECT_EQ(Name(MessageKind::kStart), "start");
  EXPECT_EQ(Name(MessageKind::kRequest), "request");
  EXPECT_EQ(Name(MessageKind::kActuators), "actuators");
  EXPECT_EQ(Name(MessageKind::kReply), "reply");
  EXPECT_EQ(Name(MessageKind::kReference), "reference");
  EXPECT_EQ(Name(MessageKind::kUnknown), "unknown");
  EXPECT_EQ(Name(MessageStatus::kOk), "ok");
  EXPECT_EQ(Name(MessageStatus::kBadLength), "bad_length");
  EXPECT_EQ(Name(MessageStatus::kUnknownId), "unknown_id");
  EXPECT_EQ(Name(MessageStatus::kNotFinite), "not_finite");
  EXPECT_EQ(Name(MessageStatus::kOutOfRange), "out_of_range");
}

}  // namespace
}  // namespace tiltproof::link
