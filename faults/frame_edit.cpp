#include "faults/frame_edit.h"

#include <bit>

#include "link/check.h"
#include "link/fletcher16.h"
#include "link/frame.h"

namespace tiltproof::faults {
namespace {

void AppendEscaped(std::uint8_t byte, std::vector<std::uint8_t>& to) {
  if (byte == link::kFlag || byte == link::kEscape) {
    to.push_back(link::kEscape);
    byte ^= link::kEscapeXor;
  }
  to.push_back(byte);
}

void AppendFrame(std::span<const std::uint8_t> payload, std::uint16_t check, std::vector<std::uint8_t>& to) {
  for (const std::uint8_t byte : payload) AppendEscaped(byte, to);
  AppendEscaped(static_cast<std::uint8_t>(check & 0xFF), to);
  AppendEscaped(static_cast<std::uint8_t>(check >> 8), to);
  to.push_back(link::kFlag);
}

}  // namespace

FrameEdit::FrameEdit(std::span<const std::uint8_t> frame) {
  while (flags_before_ < frame.size() && frame[flags_before_] == link::kFlag) ++flags_before_;
  if (flags_before_ == frame.size() || frame.back() != link::kFlag) return;
  const std::span<const std::uint8_t> content =
      frame.subspan(flags_before_, frame.size() - flags_before_ - 1);
  for (std::size_t i = 0; i < content.size(); ++i) {
    if (content[i] == link::kFlag) return;
    const bool escape = content[i] == link::kEscape;
    if (escape && ++i == content.size()) return;
    payload_.push_back(static_cast<std::uint8_t>(content[i] ^ (escape ? link::kEscapeXor : 0)));
  }
  if (payload_.size() < 2) return;
  const auto check = static_cast<std::uint16_t>(payload_[payload_.size() - 2] | payload_.back() << 8);
  payload_.resize(payload_.size() - 2);
  damage_ = static_cast<std::uint16_t>(check ^ link::Fletcher16(payload_));
  ok_ = true;
}

void FrameEdit::WriteTo(std::vector<std::uint8_t>& frame) const {
  Check(ok_, "only a whole frame is edited");
  frame.assign(flags_before_, link::kFlag);
  AppendFrame(payload_, static_cast<std::uint16_t>(link::Fletcher16(payload_) ^ damage_), frame);
}

std::vector<std::uint8_t> FrameOf(std::span<const std::uint8_t> payload) {
  std::vector<std::uint8_t> frame = {link::kFlag};
  AppendFrame(payload, link::Fletcher16(payload), frame);
  return frame;
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
