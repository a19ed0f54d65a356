// Frame layer, sending side: one type of the client's messages, as frames, to the main line's transmitter.
#pragma once

#include "firmware/messages.h"
#include "firmware/port.h"
#include "link/frame.h"

namespace tiltproof::firmware {

// The check of the dialect's frames.
constexpr link::FrameCheck CheckOf(link::Dialect dialect) {
  return dialect == link::Dialect::kHardened ? link::FrameCheck::kCrc32 : link::FrameCheck::kFletcher16;
}

class FrameSender {
 public:
  // `port` must outlive the sender.
  FrameSender(link::Dialect dialect, Port& port) : dialect_(dialect), port_(port) {}

  link::Dialect dialect() const { return dialect_; }

  // Sends the message, in `hardened` with the next number and the time. Returns when the frame's last stop bit will have
  // left.
  TimeNs Send(TimeNs now, link::MessageBytes message);

 private:
  link::Stamp NextStamp(TimeNs now);

  link::Dialect dialect_;
  link::Stamp next_;  // its number, and its least time
  Port& port_;
};

}  // namespace tiltproof::firmware
