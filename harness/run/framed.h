// A message in its frame, ready for the line.
//
//   line.Transmit(direction, now, Framed(link::EncodeReference(reference)).bytes());
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "link/frame.h"
#include "link/messages.h"

namespace tiltproof::harness {

class Framed {
 public:
  explicit Framed(const link::MessageBytes& message)
      : size_(link::EncodeFrame(message.span(), wire_).bytes.size()) {}
  std::span<const std::uint8_t> bytes() const { return {wire_.data(), size_}; }

 private:
  std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> wire_;
  std::size_t size_;
};

}  // namespace tiltproof::harness
