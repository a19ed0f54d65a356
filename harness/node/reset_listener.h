// Finds the first `start` of a board that has been reset. While the reset lasts, bytes may come from before it: the firmware
// that ran until then may repeat `start` until it is answered.
//
//   ResetListener listener(protocol);
//   listener.Hear(bytes);        // while the reset lasts: nothing passes
//   listener.ResetEnded();
//   pass = listener.Hear(bytes); // from the next `start` on, everything
//   if (!listener.passes()) pass = listener.GiveUp();  // kSilenceMax after the end
//
// A firmware may boot before the command that resets it has ended, and send `start` only once. Therefore GiveUp() returns
// the `start` that was heard during the reset, unless there was more than one: a firmware that repeats it will do so again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "harness/run/message_receiver.h"

namespace tiltproof::harness {

class ResetListener {
 public:
  static constexpr TimeNs kSilenceMax = 500 * kNsPerMs;

  // `protocol` must outlive it.
  explicit ResetListener(const link::Protocol& protocol)
      : protocol_(protocol), receiver_(protocol, link::Direction::kToPlant) {}

  // Returns the bytes that pass on to the server.
  std::vector<std::uint8_t> Hear(std::span<const std::uint8_t> bytes) {
    std::vector<std::uint8_t> passed;
    for (std::size_t i = 0; i < bytes.size() && !passes_; ++i)
      receiver_.ReceiveFrames(0, bytes.subspan(i, 1), [&](const MessageReceiver::Frame& frame) {
        if (frame.message == nullptr || !frame.message->type->starts) return;
        start_ = protocol_.framing->Encode(frame.payload);
        ++starts_count_;
        if (!ended_) return;
        passes_ = true;
        passed = start_;
        passed.insert(passed.end(), bytes.begin() + static_cast<std::ptrdiff_t>(i + 1), bytes.end());
      });
    return passed;
  }

  void ResetEnded() { ended_ = true; }

  // Lets everything pass from now on. Returns what was held back.
  std::vector<std::uint8_t> GiveUp() {
    passes_ = true;
    return starts_count_ == 1 ? start_ : std::vector<std::uint8_t>();
  }

  bool passes() const { return passes_; }

 private:
  const link::Protocol& protocol_;
  MessageReceiver receiver_;
  std::vector<std::uint8_t> start_;  // the last one, as a frame
  std::size_t starts_count_ = 0;
  bool ended_ = false, passes_ = false;
};

}  // namespace tiltproof::harness
