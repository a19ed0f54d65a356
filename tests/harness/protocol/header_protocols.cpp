#include "header_protocols.h"

#include <string>

#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"

namespace tiltproof::harness {
namespace {

using link::ByteOrder;
using link::CheckKind;
using link::Direction;
using link::FieldContent;
using link::MessageField;
using link::MessageId;
using link::MessageType;
using link::NumberType;

MessageField Field(const std::string& signal, NumberType type, ByteOrder order, double scale) {
  const double magnitude = IsInteger(type) ? 0 : 1e4;
  return {.signal = signal,
          .min = IsInteger(type) ? scale * LeastNumber(type) : -magnitude,
          .max = IsInteger(type) ? scale * LargestNumber(type) : magnitude,
          .type = type,
          .order = order,
          .scale = scale};
}

// A message with each type of number in that byte order.
MessageType AllTypes(const std::string& name, Direction direction, MessageId id, ByteOrder order) {
  MessageType type{.name = name, .direction = direction, .id = id};
  for (int i = 0; i < static_cast<int>(link::kNumberTypeCount); ++i) {
    const auto number = static_cast<NumberType>(i);
    const std::string own(Name(number));
    type.fields.push_back(Field(own + "_m", number, order, 1.0));
    type.fields.push_back(Field(own + "_rad", number, order, 0.001));
    type.fields.push_back(Field(own + "_rad_s", number, order, 1.7));
    type.fields.back().min /= 2;  // a range inside that of the type
    type.fields.back().max = type.fields.back().max / 3 + 0.1;
  }
  return type;
}

// Nearly as long as a payload can be: a block of 254 bytes without a 00 is part of many such frames.
MessageType Long(const std::string& name, Direction direction, MessageId id, ByteOrder order) {
  MessageType type{.name = name, .direction = direction, .id = id};
  for (int i = 0; i < 31; ++i)
    type.fields.push_back(Field(std::string("x").append(std::to_string(i)), NumberType::kF64, order, 0.7));
  for (int i = 0; i < 5; ++i)
    type.fields.push_back(Field(std::string("n").append(std::to_string(i)), NumberType::kU8, order, 1.0));
  return type;
}

MessageType Counted(const std::string& name, Direction direction, MessageId id, ByteOrder order) {
  MessageType type{.name = name, .direction = direction, .id = id};
  const auto count = [&](const std::string& signal, NumberType number, FieldContent content) {
    type.fields.push_back(Field(signal, number, order, 1.0));
    type.fields.back().content = content;
  };
  count("sequence", NumberType::kU16, FieldContent::kSequence);
  count("time_us", NumberType::kU32, FieldContent::kTimeUs);
  type.fields.push_back(Field("int", NumberType::kF32, order, 1.0));  // a word of C
  type.fields.push_back(Field("x-m", NumberType::kI16, order, 1e-4));
  return type;
}

link::Protocol WithFraming(const std::string& name, std::shared_ptr<const link::Framing> framing,
                           NumberType id_type, ByteOrder order) {
  const auto id = [&](std::uint32_t bits) {
    return MessageId{.type = id_type, .order = order, .bits = bits};
  };
  const ByteOrder other = order == ByteOrder::kLittle ? ByteOrder::kBig : ByteOrder::kLittle;
  link::Protocol protocol{
      .name = name, .framing = std::move(framing), .control_period_ns = 4 * kNsPerMs, .messages = {}};
  protocol.messages = {
      {.name = "start", .direction = Direction::kToPlant, .id = id(1)},
      AllTypes("actuators", Direction::kToPlant, id(0x7E), order),
      AllTypes("status", Direction::kToClient, id(2), other),
      Counted("Status", Direction::kToClient, id(0x7D), order),
      Long("long", Direction::kToClient, id(id_type == NumberType::kU16 ? 0x0105 : 5), order),
      {.name = "reference",
       .direction = Direction::kReference,
       .fields = {Field("x_m", NumberType::kF32, order, 1.0),
                  Field("yaw_rad", NumberType::kI8, order, 0.02)}}};
  for (MessageType& type : protocol.messages) type = LayOut(std::move(type));
  return protocol;
}

}  // namespace

std::vector<link::Protocol> HeaderProtocols() {
  std::vector<link::Protocol> protocols = {*FindProtocol("paper"), *FindProtocol("provant")};
  for (int i = 0; i <= static_cast<int>(LastOf(CheckKind())); ++i) {
    const auto check = static_cast<CheckKind>(i);
    const std::string name(Name(check));
    protocols.push_back(
        WithFraming("hdlc_" + name, link::MakeHdlcFraming(check), NumberType::kU8, ByteOrder::kLittle));
    protocols.push_back(
        WithFraming("cobs_" + name, link::MakeCobsFraming(check), NumberType::kU16, ByteOrder::kBig));
    protocols.push_back(WithFraming("u8-length " + name,
                                    link::MakeLengthFraming({.sync = {0xAA, 0x55}}, check), NumberType::kU16,
                                    ByteOrder::kLittle));
    protocols.push_back(
        WithFraming("2 bytes " + name,
                    link::MakeLengthFraming({.sync = {0xAA, 0xAA, 0x55, 0xAA}, .length_bytes = 2}, check),
                    NumberType::kU8, ByteOrder::kBig));
  }
  return protocols;
}

}  // namespace tiltproof::harness
