// The protocols as data, against the firmware's own encoders and decoders, which are written by hand.
#include "link/protocol.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <random>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

const Protocol& Paper() { return *harness::FindProtocol("paper"); }

Bytes ToBytes(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

// Bit by bit: NaN equals itself, and 0 is not -0.
Bytes BitsOf(const void* values, std::size_t count) {
  const auto* first = static_cast<const std::uint8_t*>(values);
  return {first, first + 4 * count};
}
Bytes BitsOf(std::span<const double> values) {
  const std::vector<float> floats(values.begin(), values.end());
  return BitsOf(floats.data(), floats.size());
}

// A decoder's result: its status, and if that is kOk, the kind of the message and its values.
struct Said {
  MessageStatus status{};
  MessageKind kind = MessageKind::kUnknown;
  Bytes values;
  friend bool operator==(const Said&, const Said&) = default;
};

Said Table(const Protocol& protocol, Direction direction, const Bytes& payload) {
  Message message;
  Said said{.status = protocol.Decode(direction, payload, message), .values = {}};
  if (said.status != MessageStatus::kOk) return said;
  said.kind = message.type->kind;
  said.values = BitsOf(message.values);
  return said;
}

template <class Group>
void Take(Said& said, MessageKind kind, const Group& group) {
  if (said.status != MessageStatus::kOk) return;
  said.kind = kind;
  said.values = BitsOf(&group, sizeof(Group) / 4);
}

Said ByHand(Dialect dialect, Direction direction, const Bytes& payload) {
  Said said;
  switch (direction) {
    case Direction::kToPlant: {
      ClientMessage message;
      said.status = DecodeClientMessage(dialect, payload, message);
      if (said.status != MessageStatus::kOk) break;
      said.kind = message.start          ? MessageKind::kStart
                  : message.read_sensors ? MessageKind::kRequest
                                         : MessageKind::kActuators;
      if (message.has_actuators) said.values = BitsOf(&message.actuators, kActuatorCount);
      break;
    }
    case Direction::kToClient: {
      Sensors sensors;
      said.status = DecodeSensors(payload, sensors);
      Take(said, MessageKind::kReply, sensors);
      break;
    }
    case Direction::kReference: {
      Reference reference;
      said.status = DecodeReference(payload, reference);
      Take(said, MessageKind::kReference, reference);
      break;
    }
  }
  return said;
}

// Payloads at the edges of everything: right lengths and wrong ones, known ids and near misses, values around every
// limit, infinities, NaN, denormals.
class Payloads {
  template <class Array>
  auto OneOf(const Array& array) {
    return array[random_() % array.size()];
  }

 public:
  Bytes Next() {
    static constexpr std::array<std::size_t, 10> kLengths = {0, 3, 4, 5, 20, 24, 28, 63, 64, 68};
    Bytes payload;
    const std::size_t length = OneOf(kLengths);
    while (payload.size() < length) Append(payload, payload.empty() && Flip() ? Id() : Value());
    payload.resize(length);
    while (!payload.empty() && random_() % 8 == 0)
      payload[random_() % payload.size()] ^= static_cast<std::uint8_t>(1U << random_() % 8);
    return payload;
  }
  float Value() {
    static constexpr std::array<float, 7> kLimits = {1e4F, 100.F, 1e3F, 1e2F, 0.F, 1.F, 1e-40F};
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(OneOf(kLimits));
    const auto sign = static_cast<std::uint32_t>(random_() % 2) << 31;
    switch (random_() % 16) {
      case 0:
        return std::bit_cast<float>(0x7F80'0000U | sign);  // infinity
      case 1:
        return std::bit_cast<float>(0x7F80'0001U | sign);  // a signalling NaN
      case 2:
        return std::bit_cast<float>(static_cast<std::uint32_t>(random_()));
      case 3:
        return std::bit_cast<float>((bits + 1) | sign);
      default:
        return std::bit_cast<float>(bits | sign);
    }
  }

 private:
  bool Flip() { return random_() % 2 == 0; }
  float Id() {
    static constexpr std::array<float, 6> kIds = {0.F, -0.F, 1.F, 2.F, 3.F, 4.F};
    return OneOf(kIds);
  }
  static void Append(Bytes& payload, float value) {
    const auto bits = std::bit_cast<std::array<std::uint8_t, 4>>(value);
    payload.insert(payload.end(), bits.begin(), bits.end());
  }

  std::mt19937_64 random_{7};
};

TEST(ProtocolTest, DecodesWhatTheFirmwaresOwnDecodersDo) {
  Payloads payloads;
  std::array<int, kMessageStatusCount> statuses{};
  for (int i = 0; i < 300'000; ++i) {
    const Bytes payload = payloads.Next();
    for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant})
      for (const Direction direction : kDirections) {
        const Said said = Table(*harness::FindProtocol(Name(dialect)), direction, payload);
        ASSERT_EQ(said, ByHand(dialect, direction, payload)) << Name(dialect) << " " << Name(direction);
        ++statuses[static_cast<std::size_t>(said.status)];
      }
  }
  for (std::size_t status = 0; status < statuses.size(); ++status) {
    if (static_cast<MessageStatus>(status) == MessageStatus::kStale)
      continue;  // a matter of several messages
    EXPECT_GT(statuses[status], 1000) << status;
  }
}

TEST(ProtocolTest, ClassifiesByLengthAndIdAlone) {
  Payloads payloads;
  for (int i = 0; i < 100'000; ++i) {
    const Bytes payload = payloads.Next();
    for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant}) {
      const Protocol& protocol = *harness::FindProtocol(Name(dialect));
      const MessageType* type = protocol.Classify(Direction::kToPlant, payload);
      ASSERT_EQ(type == nullptr ? MessageKind::kUnknown : type->kind,
                ClassifyClientPayload(dialect, payload));
      ASSERT_EQ(protocol.Classify(Direction::kToClient, payload) != nullptr, payload.size() == 64);
      ASSERT_EQ(protocol.Classify(Direction::kReference, payload) != nullptr, payload.size() == 28);
    }
  }
}

TEST(ProtocolTest, EncodesWhatTheFirmwaresOwnEncodersDo) {
  Payloads payloads;
  for (int i = 0; i < 100'000; ++i) {
    std::array<float, 16> row;
    for (float& value : row) {
      value = payloads.Value();
      // A signalling one becomes a quiet one in a double.
      if (std::isnan(value)) value = std::numeric_limits<float>::quiet_NaN();
    }
    const std::vector<double> values(row.begin(), row.end());
    const auto actuators = std::bit_cast<Actuators>(std::array{row[0], row[1], row[2], row[3]});
    const auto reference =
        std::bit_cast<Reference>(std::array{row[0], row[1], row[2], row[3], row[4], row[5], row[6]});
    const auto encode = [&](const Protocol& protocol, std::string_view name) {
      const MessageType& type = *protocol.Find(name);
      return ToBytes(protocol.Encode(type, std::span(values).first(type.fields.size())).span());
    };
    for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant}) {
      const Protocol& protocol = *harness::FindProtocol(Name(dialect));
      ASSERT_EQ(encode(protocol, "start"), ToBytes(EncodeStart(dialect, actuators).span()));
      ASSERT_EQ(encode(protocol, "request"), ToBytes(EncodeReadSensors(dialect).span()));
      ASSERT_EQ(encode(protocol, "actuators"), ToBytes(EncodeActuators(dialect, actuators).span()));
      ASSERT_EQ(encode(protocol, "reply"), ToBytes(EncodeSensors(std::bit_cast<Sensors>(row)).span()));
      ASSERT_EQ(encode(protocol, "reference"), ToBytes(EncodeReference(reference).span()));
    }
  }
}

// Fields go by name: the order on the wire is that of the firmware's structs.
TEST(ProtocolTest, FieldsHaveTheFirmwaresNamesAndOrder) {
  for (const auto& protocol : harness::ShippedProtocols()) {
    const auto expect_fields = [&](std::string_view message, const auto& fields) {
      const MessageType& type = *protocol->Find(message);
      std::vector<std::string> signals;
      for (const MessageField& field : type.fields)
        if (field.content == FieldContent::kSignal) signals.push_back(field.signal);
      ASSERT_EQ(signals.size(), fields.size());
      for (std::size_t i = 0; i < fields.size(); ++i) EXPECT_EQ(signals[i], fields[i].column);
    };
    expect_fields("reply", kSensorFields);
    expect_fields("actuators", kActuatorFields);
    expect_fields("reference", kReferenceFields);
  }
}

TEST(ProtocolTest, EachProtocolIsWhole) {
  for (const auto& protocol : harness::ShippedProtocols()) {
    SCOPED_TRACE(protocol->name);
    EXPECT_EQ(harness::FindProtocol(protocol->name), protocol);
    EXPECT_EQ(protocol->framing->name(), "hdlc");
    EXPECT_EQ(protocol->control_period_ns, 12 * kNsPerMs);
    int starts_count = 0;
    for (const MessageType& type : protocol->messages) {
      EXPECT_EQ(protocol->Find(type.name), &type);
      EXPECT_EQ(protocol->Find(type.kind), &type);
      starts_count += type.starts ? 1 : 0;
      if (type.reply.empty()) continue;
      ASSERT_NE(protocol->Find(type.reply), nullptr);
      EXPECT_EQ(protocol->Find(type.reply)->direction, Direction::kToClient);
    }
    EXPECT_EQ(starts_count, 1);
    EXPECT_EQ(protocol->Find("no such message"), nullptr);
    EXPECT_EQ(protocol->Find(MessageKind::kUnknown), nullptr);
  }
  EXPECT_EQ(harness::FindProtocol("klingon"), nullptr);
}

TEST(ProtocolTest, MessagesKeepTheirFormerNames) {
  for (const char* name : {"paper", "provant", "hardened"}) {
    const Protocol& protocol = *harness::FindProtocol(name);
    EXPECT_EQ(protocol.Find("read_sensors"), protocol.Find("request"));
    EXPECT_EQ(protocol.Find("sensors"), protocol.Find("reply"));
  }
}

// Every message of "hardened" is a message of the paper behind an id, a count and a time.
TEST(ProtocolTest, TheHardenedMessagesHaveIdCountAndTime) {
  const Protocol& hardened = *harness::FindProtocol("hardened");
  EXPECT_EQ(hardened.framing->check(), CheckKind::kCrc32IsoHdlc);
  ASSERT_EQ(hardened.messages.size(), Paper().messages.size());
  for (const MessageType& type : hardened.messages) {
    SCOPED_TRACE(type.name);
    const MessageType& papers = *Paper().Find(type.name);
    ASSERT_TRUE(type.id.has_value());
    EXPECT_EQ(type.id->type, NumberType::kU8);
    EXPECT_EQ(type.kind, papers.kind);
    EXPECT_EQ(type.reply, papers.reply);
    ASSERT_EQ(type.fields.size(), papers.fields.size() + 2);
    EXPECT_EQ(type.fields[0].content, FieldContent::kSequence);
    EXPECT_EQ(type.fields[0].offset, 1U);
    EXPECT_EQ(type.fields[0].max, 65535.0);
    EXPECT_EQ(type.fields[1].content, FieldContent::kTimeUs);
    EXPECT_EQ(type.fields[1].offset, 3U);
    for (std::size_t i = 0; i < papers.fields.size(); ++i) {
      EXPECT_EQ(type.fields[i + 2].signal, papers.fields[i].signal);
      EXPECT_EQ(type.fields[i + 2].max, papers.fields[i].max);
    }
  }
}

SignalTable TableOf(std::initializer_list<const char*> names) {
  std::vector<Signal> signals;
  for (const char* name : names) signals.push_back(SignalNamed(name, SignalFrame::kNone));
  return SignalTable(std::move(signals));
}

// The paper's messages with the signals of another vehicle, in the order of its tables; what is no state is not sent.
TEST(ProtocolTest, ThePapersMessagesCarryAnyVehicle) {
  const SignalTable states = TableOf({"x_m", "yaw_rad", "alpha_tail_rad", "vx_m_s", "alpha_tail_rad_s"});
  const VehicleSignals tricopter = {
      .states = states,
      .sensors = TableOf({"x_m", "yaw_rad", "alpha_tail_rad", "vx_m_s", "alpha_tail_rad_s", "pressure_pa"}),
      .inputs = TableOf({"f_1_n", "f_2_n", "f_3_n", "angle_tail_rad"})};
  const auto own = ForVehicle(harness::FindProtocol("paper"), tricopter);
  EXPECT_EQ(own->name, "paper");
  EXPECT_EQ(own->control_period_ns, 12 * kNsPerMs);
  EXPECT_TRUE(own->repeated_start_is_boot);
  const auto names = [&](const char* message) {
    std::vector<std::string> fields;
    for (const MessageField& field : own->Find(message)->fields) fields.push_back(field.signal);
    return fields;
  };
  EXPECT_EQ(names("reply"),
            (std::vector<std::string>{"x_m", "yaw_rad", "alpha_tail_rad", "vx_m_s", "alpha_tail_rad_s"}));
  EXPECT_EQ(names("actuators"), (std::vector<std::string>{"f_1_n", "f_2_n", "f_3_n", "angle_tail_rad"}));
  // Id 3, then the inputs, each as binary32.
  const std::array<double, 4> inputs = {1.0, 2.0, 3.0, -0.5};
  const Payload payload = own->Encode(*own->Find("actuators"), inputs);
  EXPECT_EQ(ToBytes(payload.span()),
            (std::vector<std::uint8_t>{0, 0,    0x40, 0x40, 0,    0,    0x80, 0x3F, 0, 0,
                                       0, 0x40, 0,    0,    0x40, 0x40, 0,    0,    0, 0xBF}));
  Message message;
  ASSERT_EQ(own->Decode(Direction::kToPlant, payload.span(), message), MessageStatus::kOk);
  EXPECT_EQ(message.values, std::vector<double>(inputs.begin(), inputs.end()));
  // An actuator message of the tilt-rotor with as many inputs has other limits; one with fewer another length.
  EXPECT_EQ(own->Decode(Direction::kToPlant, Paper().Encode(*Paper().Find("start"), {}).span(), message),
            MessageStatus::kOk);
  // The plausible range of an angle.
  const std::array<double, 4> absurd = {1.0, 2.0, 3.0, 101.0};
  EXPECT_EQ(own->Decode(Direction::kToPlant, own->Encode(*own->Find("actuators"), absurd).span(), message),
            MessageStatus::kOutOfRange);
}

TEST(ProtocolTest, TheTiltRotorAndOtherProtocolsStayAsTheyAre) {
  std::vector<Signal> sensors, inputs;
  for (const auto& field : kSensorFields)
    sensors.push_back(SignalNamed(std::string(field.column), SignalFrame::kNone));
  for (const auto& field : kActuatorFields)
    inputs.push_back(SignalNamed(std::string(field.column), SignalFrame::kNone));
  const SignalTable states(sensors);
  const VehicleSignals tilt_rotor = {.states = states, .sensors = states, .inputs = SignalTable(inputs)};
  EXPECT_EQ(ForVehicle(harness::FindProtocol("paper"), tilt_rotor), harness::FindProtocol("paper"));
  EXPECT_EQ(ForVehicle(harness::FindProtocol("provant"), {}), harness::FindProtocol("provant"));
}

TEST(ProtocolTest, ARefusedPayloadLeavesTheMessageAlone) {
  Message message;
  const std::array<double, 4> hover = {10.0, 10.0, 0.0, 0.0};
  const Payload right = Paper().Encode(*Paper().Find("actuators"), hover);
  ASSERT_EQ(Paper().Decode(Direction::kToPlant, right.span(), message), MessageStatus::kOk);
  const std::array<double, 4> wrong = {1.0, 2.0, 3.0, 1e9};
  EXPECT_EQ(
      Paper().Decode(Direction::kToPlant, Paper().Encode(*Paper().Find("actuators"), wrong).span(), message),
      MessageStatus::kOutOfRange);
  EXPECT_EQ(message.type, Paper().Find("actuators"));
  EXPECT_EQ(BitsOf(message.values), BitsOf(hover));
}

}  // namespace
}  // namespace tiltproof::link
