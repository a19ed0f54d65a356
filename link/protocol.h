// A protocol as data: the framing of payloads, the table of messages, the message that makes t = 0, and the
// control period.
//
// A message is a row of numbers, IEEE-754 binary32, little endian. A client's message begins with its id,
// which is also such a number; the other messages have no id and are known by their direction. A payload does
// not contain its protocol or its direction: the receiver knows both.
//
//   const Protocol& protocol = *FindProtocol("paper");
//   Message message;
//   if (protocol.Decode(Direction::kToPlant, payload, message) == MessageStatus::kOk)
//     if (!message.type->reply.empty()) Answer(*protocol.Find(message.type->reply));
//   const Payload reply = protocol.Encode(*protocol.Find("sensors"), row);
//
// A checksum lets some wrong payloads through, so a message is accepted only with its exact length, a known id, and
// every value finite and within its range. Every violation is a value of MessageStatus.
//
// The firmware does not use this: it has its own structs and encoders (firmware/messages.h). A test keeps the
// two consistent.
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
#include "link/signal_table.h"
#include "link/time.h"

namespace tiltproof::link {

struct MessageField {
  std::string signal;          // "x_m"
  float min = 0.F, max = 0.F;  // of a plausible value, inclusive; beyond them the message is damaged
};

struct MessageType {
  std::string name;
  MessageKind kind = MessageKind::kUnknown;  // its name in a fault's `message`
  Direction direction{};
  std::optional<float> id = {};  // compared bit by bit: -0.0 is not 0.0
  std::string reply = {};        // the message that answers it; empty: none
  bool starts = false;           // the first one accepted makes t = 0
  std::vector<MessageField> fields = {};

  std::size_t payload_bytes() const { return 4 * (fields.size() + (id ? 1 : 0)); }
};

// A message that was accepted: one value for each field of its type.
struct Message {
  const MessageType* type = nullptr;  // of the protocol's table
  std::vector<float> values;
};

// A fixed buffer with the bytes in use.
struct Payload {
  std::array<std::uint8_t, kPayloadBytesMax> bytes{};
  std::size_t size = 0;
  std::span<const std::uint8_t> span() const { return {bytes.data(), size}; }
};

struct Protocol {
  std::string name;
  std::shared_ptr<const Framing> framing = HdlcFraming();
  TimeNs control_period_ns = 0;  // of the client's requests, the references and the rows of the trace
  // True if the server answers requests before t = 0, while the vehicle does not move.
  bool answers_before_start = false;
  // True if a repeated message that starts means that the client has rebooted. If false, the repetition has no
  // meaning of its own.
  bool repeated_start_is_boot = false;
  std::vector<MessageType> messages;

  // Null when there is none. The second function finds the only message of its kind.
  const MessageType* Find(std::string_view message) const;
  const MessageType* Find(MessageKind kind) const;

  // The message type of a payload in that direction, judged only by length and id; null when it is no
  // message.
  const MessageType* Classify(Direction direction, std::span<const std::uint8_t> payload) const;

  // Sets `message` only when it returns kOk. When there are several violations, it returns the first in this list:
  // kBadLength (shorter than an id), kUnknownId, kBadLength (of the message), kNotFinite (anywhere),
  // kOutOfRange.
  MessageStatus Decode(Direction direction, std::span<const std::uint8_t> payload, Message& message) const;

  // `values`: one per field. They are sent unchanged, even if not finite or out of range: the sender is
  // responsible for them.
  Payload Encode(const MessageType& type, std::span<const float> values) const;
};

// A field's number in a payload that is a message of that type by its length and id (Protocol::Classify()), whatever it
// is.
float FieldValue(const MessageType& type, std::span<const std::uint8_t> payload, std::size_t field);

// The built-in protocols: "paper" is the paper's (section 2.1, Figure 3), "provant" that of the authors'
// published server.
std::span<const std::shared_ptr<const Protocol>> Protocols();
// Null when there is no protocol of that name.
std::shared_ptr<const Protocol> FindProtocol(std::string_view name);

// The protocol as a vehicle with these signals speaks it. The messages of "paper" carry the vehicle's sensed states and
// its inputs, in the order of its tables; for the tilt-rotor they are those of FindProtocol("paper"), and that is
// returned. Any other protocol is returned as it is.
std::shared_ptr<const Protocol> ForVehicle(std::shared_ptr<const Protocol> protocol,
                                           const VehicleSignals& vehicle);

}  // namespace tiltproof::link
