#include "faults/frame_edit.h"

#include <bit>

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

float FloatAt(std::span<const std::uint8_t> payload, std::size_t offset) {
  CheckPart(offset, 4, payload.size(), "a number is inside its payload");
  std::uint32_t bits = 0;
  for (std::size_t i = 4; i-- > 0;) bits = bits << 8 | payload[offset + i];
  return std::bit_cast<float>(bits);
}

void SetFloat(std::span<std::uint8_t> payload, std::size_t offset, float value) {
  CheckPart(offset, 4, payload.size(), "a number is inside its payload");
  const auto bits = std::bit_cast<std::uint32_t>(value);
  for (std::size_t i = 0; i < 4; ++i) payload[offset + i] = static_cast<std::uint8_t>(bits >> (8 * i));
}

}  // namespace tiltproof::faults
