// Messages of both dialects: the firmware's decoders (firmware/messages.h) and the harness's tables
// (link/protocol.h), which share no code, agree on every payload; what is accepted is the encoding of what was
// understood. A value that an enumeration does not have is an unknown one to all of them.
//
// Input: the payload. Its first byte is also taken for a value of each enumeration.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/messages.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/frame.h"
#include "link/protocol.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using tiltproof::testing::Require;
namespace link = tiltproof::link;
using link::MessageStatus;
using Payload = std::span<const std::uint8_t>;

// The tables' judgement; what they accept comes back as it was.
MessageStatus ByTable(const link::Protocol& protocol, link::Direction direction, Payload payload) {
  link::Message message;
  const MessageStatus status = protocol.Decode(direction, payload, message);
  const link::MessageType* type = protocol.Classify(direction, payload);
  Require(!Name(status).empty(), "a status has a name");
  if (status != MessageStatus::kOk) {
    Require(message.type == nullptr && message.values.empty(), "a refused message leaves nothing");
    return status;
  }
  Require(protocol.Find(type->name) == type && protocol.Find(type->kind) == type, "a type is found");
  Require(!Name(type->kind).empty(), "a kind has a name");
  Require(type == message.type, "accepted as what it was classified");
  Require(std::ranges::equal(protocol.Encode(*type, message.values).span(), payload),
          "by table: a round trip");
  return status;
}

void CheckSensors(Payload payload) {
  tiltproof::Sensors sensors;
  const MessageStatus status = link::DecodeSensors(payload, sensors);
  if (status == MessageStatus::kOk)
    Require(std::ranges::equal(link::EncodeSensors(sensors).span(), payload), "sensors: a round trip");
  const bool parsed = link::ParseSensors(payload, sensors) == MessageStatus::kOk;
  Require(parsed == (payload.size() == link::kSensorMessageBytes), "parsed by length alone");
  if (!parsed) return;
  Require(std::ranges::equal(link::EncodeSensors(sensors).span(), payload), "parsed: a round trip");
  for (std::size_t refused_max = 0; refused_max <= tiltproof::kSensorCount; ++refused_max) {
    tiltproof::Sensors partly;
    const bool accepted = link::DecodeSensorsPartly(payload, refused_max, partly) == MessageStatus::kOk;
    std::size_t refused = 0;
    for (const auto& field : tiltproof::kSensorFields) refused += std::isnan(partly.*field.in_float) ? 1 : 0;
    Require(refused <= refused_max, "no more single values are refused than may be");
    if (refused_max == 0) Require(accepted == (status == MessageStatus::kOk), "all of it, or nothing");
    if (refused_max == tiltproof::kSensorCount) Require(accepted, "every value may be refused");
  }
}

MessageStatus CheckRequest(link::Dialect dialect, Payload payload) {
  link::ClientMessage message;
  const MessageStatus status = link::DecodeClientMessage(dialect, payload, message);
  const link::MessageKind kind = link::ClassifyClientPayload(dialect, payload);
  Require(!Name(kind).empty(), "a kind has a name");
  if (status != MessageStatus::kOk) return status;
  Require(kind != link::MessageKind::kUnknown, "accepted and classified");
  link::MessageBytes again = message.start          ? link::EncodeStart(dialect, message.actuators)
                             : message.read_sensors ? link::EncodeReadSensors(dialect)
                                                    : link::EncodeActuators(dialect, message.actuators);
  SetStamp(dialect, message.stamp, again);
  Require(std::ranges::equal(again.span(), payload), "a request: a round trip");
  return status;
}

// The firmware's code refuses in the same payloads what the table refuses. The filter has accepted nothing before.
void CheckHardened(Payload payload) {
  constexpr link::Dialect kDialect = link::Dialect::kHardened;
  const link::Protocol& protocol = *tiltproof::harness::FindProtocol(Name(kDialect));
  Require(CheckRequest(kDialect, payload) == ByTable(protocol, link::Direction::kToPlant, payload),
          "a hardened request: code and table agree");
  const auto reply = link::HeaderFilter(kDialect, link::MessageKind::kReply).Values(payload);
  tiltproof::Sensors sensors;
  const bool is_reply = reply && link::DecodeSensors(*reply, sensors) == MessageStatus::kOk;
  Require(is_reply == (ByTable(protocol, link::Direction::kToClient, payload) == MessageStatus::kOk),
          "a hardened reply: code and table agree");
  const auto values = link::HeaderFilter(kDialect, link::MessageKind::kReference).Values(payload);
  tiltproof::Reference reference;
  const bool is_reference = values && link::DecodeReference(*values, reference) == MessageStatus::kOk;
  Require(is_reference == (ByTable(protocol, link::Direction::kReference, payload) == MessageStatus::kOk),
          "a hardened reference: code and table agree");
}

// Enumerations come out of records and over the C interface of firmware: any byte has a name, its own or "unknown".
template <class Value>
void CheckName(std::uint8_t byte, Value last) {
  const std::string_view name = Name(static_cast<Value>(byte));
  if (static_cast<Value>(byte) > last) {
    Require(name == "unknown", "what an enumeration does not have is unknown");
    return;
  }
  Require(!name.empty(), "a value has a name");
  for (unsigned other = 0; other < byte; ++other)
    Require(Name(static_cast<Value>(other)) != name, "a name of its own");
}

// No protocol has that name, and there is nothing to say or to understand in it.
void CheckUnknownDialect(link::Dialect dialect, Payload payload) {
  Require(tiltproof::harness::FindProtocol(Name(dialect)) == nullptr, "an unknown dialect has no protocol");
  Require(link::EncodeStart(dialect, {}).span().empty() && link::EncodeReadSensors(dialect).span().empty() &&
              link::EncodeActuators(dialect, {}).span().empty(),
          "an unknown dialect says nothing");
  link::ClientMessage message;
  Require(link::DecodeClientMessage(dialect, payload, message) == MessageStatus::kUnknownId,
          "an unknown dialect has no message");
  Require(link::ClassifyClientPayload(dialect, payload) == link::MessageKind::kUnknown,
          "an unknown dialect has no kind");
}

void CheckEnumerations(std::uint8_t byte, Payload payload) {
  CheckName(byte, link::FrameStatus::kNoOpeningFlag);
  CheckName(byte, link::MessageKind::kUnknown);
  CheckName(byte, MessageStatus::kStale);
  CheckName(byte, link::Dialect::kHardened);
  if (const auto dialect = static_cast<link::Dialect>(byte); dialect > link::Dialect::kHardened)
    CheckUnknownDialect(dialect, payload);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Payload payload(data, size);
  if (size > 0) CheckEnumerations(data[0], payload);
  CheckSensors(payload);
  CheckHardened(payload);
  tiltproof::Sensors sensors;
  tiltproof::Reference reference;
  const MessageStatus as_sensors = link::DecodeSensors(payload, sensors);
  const MessageStatus as_reference = link::DecodeReference(payload, reference);
  if (as_reference == MessageStatus::kOk)
    Require(std::ranges::equal(link::EncodeReference(reference).span(), payload),
            "a reference: a round trip");
  for (const link::Dialect dialect : {link::Dialect::kPaper, link::Dialect::kProvant}) {
    const link::Protocol& protocol = *tiltproof::harness::FindProtocol(Name(dialect));
    Require(CheckRequest(dialect, payload) == ByTable(protocol, link::Direction::kToPlant, payload),
            "a request: code and table agree");
    Require(as_sensors == ByTable(protocol, link::Direction::kToClient, payload),
            "sensors: code and table agree");
    Require(as_reference == ByTable(protocol, link::Direction::kReference, payload),
            "a reference: code and table agree");
  }
  return 0;
}
