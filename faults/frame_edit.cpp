#include "faults/frame_edit.h"

#include "link/check.h"

namespace tiltproof::faults {

FrameEdit::FrameEdit(const link::Framing& framing, std::span<const std::uint8_t> frame)
    : framing_(framing), parts_(framing.Split(frame)) {
  if (!parts_) return;
  const auto opening = frame.first(parts_->opening_bytes);
  opening_.assign(opening.begin(), opening.end());
}

void FrameEdit::WriteTo(std::vector<std::uint8_t>& frame) const {
  Check(ok(), "only a whole frame is edited");
  frame = opening_;
  framing_.AppendBehindOpening(parts_->payload, parts_->damage, frame);
}

}  // namespace tiltproof::faults
