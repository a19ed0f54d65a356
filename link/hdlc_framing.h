// HDLC-like framing (RFC 1662): flags 7E, escapes 7D. With Fletcher-16 it is that of the paper's protocol, of which
// link/frame.h is the codec.
#pragma once

#include <memory>

#include "link/framing.h"

namespace tiltproof::link {

// Its name is "hdlc". The first one has Fletcher-16.
const std::shared_ptr<const Framing>& HdlcFraming();
std::shared_ptr<const Framing> MakeHdlcFraming(CheckKind check);

}  // namespace tiltproof::link
