// Frames with their length in front: bytes that mark the start, the length of the payload, the payload and its check.
//
//   MakeLengthFraming({.sync = {0xAA, 0x55}}, CheckKind::kCrc16Ibm3740);
//
// Neither the marks nor the length are covered by the check. The reader does not read bytes a second time: a damaged
// length takes the bytes that follow for its payload, and with them the frames in these bytes.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "link/framing.h"

namespace tiltproof::link {

struct LengthFormat {
  std::vector<std::uint8_t> sync;  // 1 to LengthHeader::kSyncBytesMax bytes
  std::size_t length_bytes = 1;    // 1 or 2; two are sent with the low byte first
};

// Its name is "length_prefixed".
std::shared_ptr<const Framing> MakeLengthFraming(const LengthFormat& format, CheckKind check);

}  // namespace tiltproof::link
