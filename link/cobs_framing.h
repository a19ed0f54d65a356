// Consistent Overhead Byte Stuffing (Cheshire and Baker, IEEE/ACM Transactions on Networking 7(2), 1999): a 00 ends each
// frame and stands nowhere in it. A code, the distance to the next 00, stands in place of each 00 of payload and check.
#pragma once

#include <memory>

#include "link/framing.h"

namespace tiltproof::link {

// Its name is "cobs".
std::shared_ptr<const Framing> MakeCobsFraming(CheckKind check);

}  // namespace tiltproof::link
