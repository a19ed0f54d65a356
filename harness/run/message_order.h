// Numbers and times of messages (link::FieldContent): the sender writes them, and the receiver finds messages that are
// not newer than the one of their type before.
//
//   MessageStamps stamps(protocol);                  // of one sender
//   stamps.Write(type, now, values);                 // once for each message
//
//   MessageOrder order(protocol);                    // of one receiver
//   const link::MessageStatus status = order.Decode(link::Direction::kToPlant, payload, message);  // kStale, too
//
// The number on the line wraps at the size of its type. Of two numbers the newer one is less than half of that range
// ahead of the other.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "link/protocol.h"
#include "link/time.h"

namespace tiltproof::harness {

class MessageStamps {
 public:
  // `protocol` must outlive it, and has the types of all messages.
  explicit MessageStamps(const link::Protocol& protocol)
      : protocol_(&protocol), counts_(protocol.messages.size()) {}

  // Sets the fields that hold a number, from 0 on, or the time `now` of the sender. The others stay as they are.
  void Write(const link::MessageType& type, BootTime now, std::span<double> values);

 private:
  const link::Protocol* protocol_;
  std::vector<std::uint64_t> counts_;  // of the messages sent, by type
};

class MessageOrder {
 public:
  // `protocol` must outlive it, and has the types of all messages.
  explicit MessageOrder(const link::Protocol& protocol);

  // As Protocol::Decode, and kStale for a good message that is not newer.
  link::MessageStatus Decode(link::Direction direction, std::span<const std::uint8_t> payload,
                             link::Message& message) {
    const link::MessageStatus status = protocol_->Decode(direction, payload, message);
    return status == link::MessageStatus::kOk && !Takes(message) ? link::MessageStatus::kStale : status;
  }

  // False for a stale message. A start that means a boot is never stale, and all types begin again with it.
  bool Takes(const link::Message& message) { return !is_used_ || Judge(message); }

 private:
  bool Judge(const link::Message& message);

  const link::Protocol* protocol_;
  bool is_used_;                           // some message has a number or a time
  std::vector<std::vector<double>> last_;  // values of the last message of each type; empty: none
};

}  // namespace tiltproof::harness
