// The framing of the paper's protocol, of which link/frame.h is the codec: flags 7E, escapes 7D, Fletcher-16.
#pragma once

#include <memory>

#include "link/framing.h"

namespace tiltproof::link {

// Its name is "hdlc": it is HDLC-like framing (RFC 1662) with another check.
const std::shared_ptr<const Framing>& HdlcFraming();

}  // namespace tiltproof::link
