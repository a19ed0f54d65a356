// Activity 4 of 4: receives references from the base station or the joystick reader on the second line
// (paper, section 2.2, Figure 6): frames whose payload is 7 floats, no service, no reply. In the dialect `hardened` they
// are numbered, and a repeated or older one is refused.
#pragma once

#include <optional>
#include <span>

#include "firmware/frame_sender.h"
#include "firmware/sensor_reader.h"
#include "firmware/signals.h"
#include "link/frame.h"

namespace tiltproof::firmware {

class ReferenceReceiver {
 public:
  ReferenceReceiver(link::Dialect dialect, ValueChecks checks)
      : checks_(checks), decoder_(CheckOf(dialect)), filter_(dialect, link::MessageKind::kReference) {}

  void Receive(std::span<const std::uint8_t> bytes);

  // The last valid one that came since the last call.
  std::optional<Reference> TakeReference();

 private:
  void Accept(std::span<const std::uint8_t> payload);

  ValueChecks checks_;
  link::FrameDecoder decoder_;
  link::HeaderFilter filter_;
  std::optional<Reference> received_;
};

}  // namespace tiltproof::firmware
