#include "firmware/frame_sender.h"

#include <array>
#include <cstdint>

namespace tiltproof::firmware {

TimeNs FrameSender::Send(TimeNs now, link::MessageBytes message) {
  if (dialect_ == link::Dialect::kHardened) link::SetStamp(dialect_, NextStamp(now), message);
  constexpr std::size_t kPayloadBytes = link::kHardenedHeaderBytes + 4 * kActuatorCount;  // the longest
  std::array<std::uint8_t, link::FrameBytesMax(kPayloadBytes, link::FrameCheck::kCrc32)> wire;
  return port_.Transmit(Uart::kMain, now, link::EncodeFrame(message.span(), wire, CheckOf(dialect_)).bytes);
}

// A board counts time in ticks. A second message in one tick has a later time, because a receiver may refuse one that is
// not later.
link::Stamp FrameSender::NextStamp(TimeNs now) {
  constexpr std::uint32_t kTicksUs = 1'000'000;  // many ticks
  const auto now_us = static_cast<std::uint32_t>(now / kNsPerUs);
  const bool is_later = next_.time_us - now_us > kTicksUs;
  const link::Stamp stamp = {.sequence = next_.sequence, .time_us = is_later ? now_us : next_.time_us};
  next_ = {.sequence = static_cast<std::uint16_t>(stamp.sequence + 1), .time_us = stamp.time_us + 1};
  return stamp;
}

}  // namespace tiltproof::firmware
