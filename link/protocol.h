// A protocol as data: the framing of payloads, the table of messages, the message that makes t = 0, and the
// control period.
//
// A message is a row of numbers (link/number.h). It may begin with its id; a message without an id is known by its
// direction. A payload does not contain its protocol or its direction: the receiver knows both.
//
//   Message message;
//   if (protocol.Decode(Direction::kToPlant, payload, message) == MessageStatus::kOk)
//     if (!message.type->reply.empty()) Answer(*protocol.Find(message.type->reply));
//   const Payload reply = protocol.Encode(*protocol.Find("reply"), row);
//
// A checksum lets some wrong payloads through, so a message is accepted only with its exact length, a known id, and
// every value finite and within its range. Every violation is a value of MessageStatus.
//
// Values here are those of the line: the signals of a vehicle in the axes and the unit that the protocol has them in.
// harness/run/message_binding.h converts them.
//
// Protocols come from files (harness/scenario/protocol_file.h), because this folder reads no YAML. The firmware does not
// use this: it has its own structs and encoders (firmware/messages.h). A test keeps the two consistent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/chunk.h"
#include "link/framing.h"
#include "link/hdlc_framing.h"
#include "link/message_kind.h"
#include "link/number.h"
#include "link/signal_table.h"
#include "link/time.h"

namespace tiltproof::link {

// The content of a field, apart from signals: a count of the messages of its type that their sender has sent, from 0,
// which wraps; and the sender's time in microseconds, which wraps. A receiver refuses a message with the number of its
// predecessor, or an older one.
enum class FieldContent : std::uint8_t { kSignal, kSequence, kTimeUs };

// The unit of a rotor's thrust on the line: newton, its share of the largest thrust, or the share of the largest speed,
// whose square is that of the thrust.
enum class ThrustUnit : std::uint8_t { kNewton, kShare, kShareOfSpeed };
std::string_view Name(ThrustUnit unit);  // "share_of_speed"

struct MessageField {
  std::string signal;           // "x_m"; "sequence" and "time_us" are no signals
  double min = 0.0, max = 0.0;  // of a plausible value, inclusive; beyond them the message is damaged
  NumberType type = NumberType::kF32;
  ByteOrder order = ByteOrder::kLittle;
  double scale = 1.0;  // the value is scale * the number on the line; > 0
  FieldContent content = FieldContent::kSignal;
  ThrustUnit as = ThrustUnit::kNewton;
  std::size_t offset = 0;  // in the payload, in bytes; LayOut() sets it
};

struct MessageId {
  NumberType type = NumberType::kF32;
  ByteOrder order = ByteOrder::kLittle;
  std::uint32_t bits = 0;  // compared bit by bit: -0.0 is not 0.0
};
// The id of the paper's messages: a binary32, little endian.
MessageId FloatId(float value);

struct MessageType {
  std::string name;
  MessageKind kind = MessageKind::kUnknown;  // its role
  Direction direction{};
  std::optional<MessageId> id = {};
  std::string reply = {};  // the message that answers it; empty: none
  bool starts = false;     // the first one accepted makes t = 0
  TimeNs period_ns = 0;    // between two that the server sends by itself; 0: it sends none so
  std::vector<MessageField> fields = {};
  std::size_t payload_bytes = 0;  // LayOut() sets it
  bool has_signals() const;       // beside numbers and times of messages
};

// Beyond this magnitude a value of that signal is not one of a small aircraft but of a damaged message. The end of the
// name gives its unit; infinite for a name without.
double PlausibleMagnitude(std::string_view signal);

// The value that a receiver reads when this one is sent: rounded, and within the field's type.
double ValueOnLine(const MessageField& field, double value);

// Sets the offsets of the fields and the length of the payload.
MessageType LayOut(MessageType type);

// A message that was accepted: one value for each field of its type.
struct Message {
  const MessageType* type = nullptr;  // of the protocol's table
  std::vector<double> values;
};

// A fixed buffer with the bytes in use.
struct Payload {
  std::array<std::uint8_t, kPayloadBytesMax> bytes{};
  std::size_t size = 0;
  std::span<const std::uint8_t> span() const { return {bytes.data(), size}; }
};

// Axes of the signals on the line. World: x east, y north, z up; or x north, y east, z down. Body: x forward, y left,
// z up; or x forward, y right, z down.
enum class WorldAxes : std::uint8_t { kEnu, kNed };
enum class BodyAxes : std::uint8_t { kFlu, kFrd };
std::string_view Name(WorldAxes axes);
std::string_view Name(BodyAxes axes);

struct Protocol {
  std::string name;
  std::shared_ptr<const Framing> framing = HdlcFraming();
  TimeNs control_period_ns = 0;  // of the client's requests, the references and the rows of the trace
  // True if the server answers requests before t = 0, while the vehicle does not move.
  bool answers_before_start = false;
  // True if a repeated message that starts means that the client has rebooted. If false, the repetition has no
  // meaning of its own.
  bool repeated_start_is_boot = false;
  WorldAxes world = WorldAxes::kEnu;
  BodyAxes body = BodyAxes::kFlu;
  // True if replies and actuator messages carry the signals of the scenario's vehicle in place of their own
  // (ForVehicle()).
  bool any_vehicle = false;
  std::vector<MessageType> messages;  // laid out

  // Null when there is none. The first function also takes "sensors" and "read_sensors", which the messages `reply` and
  // `request` of the paper were called before. The second one finds the first message of its kind.
  const MessageType* Find(std::string_view message) const;
  const MessageType* Find(MessageKind kind) const;

  // The message that a client sends once in each control period: its first request; its first actuator message when it
  // needs no request, because the server sends by itself at least once in each period. A protocol has one of the two.
  const MessageType& PeriodMessage() const;
  bool streams() const { return PeriodMessage().kind == MessageKind::kActuators; }

  // The message type of a payload in that direction, judged only by length and id; null when it is no
  // message.
  const MessageType* Classify(Direction direction, std::span<const std::uint8_t> payload) const;

  // Sets `message` only when it returns kOk. When there are several violations, it returns the first in this list:
  // kBadLength (shorter than an id), kUnknownId, kBadLength (of the message), kNotFinite (anywhere),
  // kOutOfRange.
  MessageStatus Decode(Direction direction, std::span<const std::uint8_t> payload, Message& message) const;

  // `values`: one per field. They are sent as StoreNumber() writes them, even if not finite or out of range: the
  // sender is responsible for them.
  Payload Encode(const MessageType& type, std::span<const double> values) const;
};

// A field's value in a payload that is a message of that type by its length and id (Protocol::Classify()), whatever it
// is.
double FieldValue(const MessageType& type, std::span<const std::uint8_t> payload, std::size_t field);
// Writes it there, as StoreNumber() does.
void SetFieldValue(const MessageType& type, std::span<std::uint8_t> payload, std::size_t field, double value);

// True if all messages of both have the same bytes and meaning, whatever the names of protocols and messages and the
// ranges of their values are.
bool SameOnTheLine(const Protocol& a, const Protocol& b);

// The protocol as a vehicle with these signals speaks it. With `any_vehicle`, replies carry the vehicle's sensed states
// and actuator messages its inputs, in the order of its tables and as f32, behind sequence and time. The same object is
// returned when nothing changes.
std::shared_ptr<const Protocol> ForVehicle(std::shared_ptr<const Protocol> protocol,
                                           const VehicleSignals& vehicle);

}  // namespace tiltproof::link
