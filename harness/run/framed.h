// A message in its frame, ready for the line.
//
//   line.Transmit(direction, now, Framed(protocol.Encode(type, row).span()).bytes());
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "link/check.h"
#include "link/frame.h"

namespace tiltproof::harness {

class Framed {
 public:
  explicit Framed(std::span<const std::uint8_t> payload)
      : size_(link::EncodeFrame(payload, wire_).bytes.size()) {
    Check(size_ > payload.size() && wire_.front() == link::kFlag && wire_[size_ - 1] == link::kFlag,
          "the codec frames every message of a protocol");
  }
  std::span<const std::uint8_t> bytes() const { return {wire_.data(), size_}; }

 private:
  std::array<std::uint8_t, link::FrameBytesMax(link::kPayloadBytesMax)> wire_;
  std::size_t size_;
};

}  // namespace tiltproof::harness
