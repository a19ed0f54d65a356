// Editing a frame's payload, for models of senders that build frames well but with wrong content.
//
//   FrameEdit edit(*protocol.framing, chunk.bytes);
//   if (edit.ok()) {
//     edit.payload().push_back(0);
//     edit.WriteTo(chunk.bytes);  // a whole frame, with the check of the new payload
//   }
//
// A frame that was damaged before stays damaged: the bits in which its check was wrong are wrong in the new
// one, too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "link/framing.h"

namespace tiltproof::faults {

class FrameEdit {
 public:
  FrameEdit(const link::Framing& framing, std::span<const std::uint8_t> frame);

  // True if it is one frame with a payload and a check. The others need it.
  bool ok() const { return parts_.has_value(); }
  std::vector<std::uint8_t>& payload() { return parts_->payload; }
  // The frame with the payload as it is now, behind the opening that it had.
  void WriteTo(std::vector<std::uint8_t>& frame) const;

 private:
  const link::Framing& framing_;
  std::vector<std::uint8_t> opening_;
  std::optional<link::FrameParts> parts_;
};

}  // namespace tiltproof::faults
