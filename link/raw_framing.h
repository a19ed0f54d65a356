// Bytes without frames: what is given to a wire at once is one chunk, and nothing is known of its content.
//
//   Wire wire({.baud = 921600}, Direction::kToPlant, *RawProtocol(), filter);   // RawProtocol() outlives it
//
// No part encodes or reads frames of it, so Encode() gives the payload itself, and readers find nothing.
#pragma once

#include <memory>

#include "link/protocol.h"

namespace tiltproof::link {

// The protocol "bytes", without messages: of a line between boards that has no protocol.
const std::shared_ptr<const Protocol>& RawProtocol();

}  // namespace tiltproof::link
