// Counts what the client sends on the reference line, where no component listens: a sign that its two UARTs
// are swapped.
//
//   talk.Hear(bytes);  ...  if (const std::string text = talk.Trouble(); !text.empty()) Note(kLineTroubleEvent, text);
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "harness/run/message_receiver.h"

namespace tiltproof::harness {

class ReferenceTalk {
 public:
  explicit ReferenceTalk(const link::Protocol& protocol) : receiver_(protocol, link::Direction::kToPlant) {}

  void Hear(std::span<const std::uint8_t> bytes) {
    bytes_count_ += static_cast<std::int64_t>(bytes.size());
    receiver_.Receive(bytes, [this](const link::Message&) { ++messages_count_; });
  }
  // Empty when the client is silent there.
  std::string Trouble() const {
    if (bytes_count_ == 0) return "";
    const std::string bytes = std::to_string(bytes_count_) + (bytes_count_ == 1 ? " byte" : " bytes");
    if (messages_count_ == 0)
      return "the client sends on the reference line (" + bytes +
             ", none of the protocol's messages), which it should only listen to";
    return "the client talks on the reference line (" + bytes + ", " + std::to_string(messages_count_) +
           " messages of the protocol): its two UARTs are exchanged. Check which one the firmware takes for "
           "the main "
           "line, the wiring, and main= and reference= of --client qemu or DEV,REFDEV of --client serial";
  }

 private:
  MessageReceiver receiver_;
  std::int64_t bytes_count_ = 0, messages_count_ = 0;
};

}  // namespace tiltproof::harness
