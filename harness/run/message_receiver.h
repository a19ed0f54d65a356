// Turns the bytes of one direction into checked messages. All code that needs to know what was said uses
// this.
//
//   MessageReceiver receiver(protocol, Direction::kToPlant);
//   receiver.Receive(bytes, [&](const link::Message& message) { server.Receive(client, now, message, reply); });
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "harness/run/message_order.h"
#include "link/protocol.h"

namespace tiltproof::harness {

class MessageReceiver {
 public:
  // `protocol` must outlive it.
  MessageReceiver(const link::Protocol& protocol, link::Direction direction)
      : protocol_(&protocol),
        direction_(direction),
        reader_(protocol.framing->MakeReader()),
        order_(protocol) {}

  // A frame that has ended, or bytes that are none.
  struct Frame {
    // Number of the chunk (link::Chunk::number) that brought the last byte of the frame's content. The flag
    // that closes a frame may belong to the next one.
    std::uint64_t number;
    std::string_view rejected;  // a status of the framing or Name() of a link::MessageStatus; empty: accepted
    std::span<const std::uint8_t>
        payload;                   // of a whole frame, accepted or not; these two are valid during the call
    const link::Message* message;  // null when it was rejected
  };
  // Calls on_frame(const Frame&) for each frame that ends in `bytes`. All bytes belong to the chunk with that
  // number.
  template <class OnFrame>
  void ReceiveFrames(std::uint64_t number, std::span<const std::uint8_t> bytes, const OnFrame& on_frame) {
    const std::size_t flag_count = CountFlags(*protocol_->framing, bytes);
    Decode(bytes.first(flag_count), on_frame);
    if (flag_count == bytes.size()) return;
    number_ = number;
    Decode(bytes.subspan(flag_count), on_frame);
  }

  // Calls on_message(const link::Message&) for each message that is accepted.
  template <class OnMessage>
  void Receive(std::span<const std::uint8_t> bytes, const OnMessage& on_message) {
    ReceiveFrames(0, bytes, [&](const Frame& frame) {
      if (frame.message != nullptr) on_message(*frame.message);
    });
  }

 private:
  template <class OnFrame>
  void Decode(std::span<const std::uint8_t> bytes, const OnFrame& on_frame) {
    while (const auto read = reader_->Next(bytes)) on_frame(Check(*read));
  }
  Frame Check(const link::FrameReading& read) {
    if (!read.ok) return {number_, read.status, {}, nullptr};
    const link::MessageStatus status = order_.Decode(direction_, read.payload, message_);
    if (status != link::MessageStatus::kOk) return {number_, Name(status), read.payload, nullptr};
    return {number_, {}, read.payload, &message_};
  }

  const link::Protocol* protocol_;
  link::Direction direction_;
  std::unique_ptr<link::FrameReader> reader_;
  MessageOrder order_;
  std::uint64_t number_ = 0;
  link::Message message_;
};

// Finds t = 0: the arrival of the last byte of the first accepted message that starts. The server does this,
// and in real time also the link node, for the faults of its wires. All other parts are told.
class OriginFinder {
 public:
  // True if this message makes t = 0.
  bool Note(BootTime arrival, const link::Message& message) {
    if (origin_.known() || !message.type->starts) return false;
    origin_ = Origin(arrival);
    return true;
  }
  Origin origin() const { return origin_; }

 private:
  Origin origin_;
};

}  // namespace tiltproof::harness
