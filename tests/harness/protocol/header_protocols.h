// Protocols for tests of their C headers: every framing with every check, every type of number in both byte orders, scaled
// and not, and ids of every type.
#pragma once

#include <vector>

#include "link/protocol.h"

namespace tiltproof::harness {

std::vector<link::Protocol> HeaderProtocols();

}  // namespace tiltproof::harness
