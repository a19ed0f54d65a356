// Turns the bytes of one direction into checked messages. All code that needs to know what was said uses
// this.
//
//   MessageReceiver receiver(protocol, Direction::kToPlant);
//   receiver.Receive(bytes, [&](const link::Message& message) { server.Receive(client, now, message, reply); });
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string_view>

#include "link/protocol.h"

namespace tiltproof::harness {

class MessageReceiver {
 public:
  // `protocol` must outlive it.
  MessageReceiver(const link::Protocol& protocol, link::Direction direction)
      : protocol_(&protocol), direction_(direction) {}

  // The result of the bytes between two flags.
  struct Frame {
    // Number of the chunk (link::Chunk::number) that brought the last byte of the frame's content. The flag
    // that closes a frame may belong to the next one.
    std::uint64_t number;
    std::string_view rejected;  // Name() of a link::FrameStatus or link::MessageStatus; empty: accepted
    std::span<const std::uint8_t>
        payload;                   // of a whole frame, accepted or not; these two are valid during the call
    const link::Message* message;  // null when it was rejected
  };
  // Calls on_frame(const Frame&) for each frame that ends in `bytes`. All bytes belong to the chunk with that
  // number.
  template <class OnFrame>
  void ReceiveFrames(std::uint64_t number, std::span<const std::uint8_t> bytes, const OnFrame& on_frame) {
    const std::uint8_t flag = protocol_->framing.flag;
    const auto content = std::find_if(bytes.begin(), bytes.end(), [&](auto byte) { return byte != flag; });
    const auto flag_count = static_cast<std::size_t>(content - bytes.begin());
    Decode(bytes.first(flag_count), on_frame);
    if (content == bytes.end()) return;
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
    while (const auto event = decoder_.Next(bytes)) on_frame(Check(*event));
  }
  Frame Check(const link::FrameEvent& event) {
    if (event.status != link::FrameStatus::kOk) return {number_, Name(event.status), {}, nullptr};
    const link::MessageStatus status = protocol_->Decode(direction_, event.payload, message_);
    if (status != link::MessageStatus::kOk) return {number_, Name(status), event.payload, nullptr};
    return {number_, {}, event.payload, &message_};
  }

  const link::Protocol* protocol_;
  link::Direction direction_;
  link::FrameDecoder decoder_;
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
