// Counts how a client uses its protocol: what it sent, before any fault on the line, against what arrived at it.
// Whatever a protocol says, a client asks once a period, answers what it hears, and sends only its messages.
//
//   AddProtocolUse(log, 0, *scenario.link.protocol, scenario.link.main_rate());   // once log is in order of time
#pragma once

#include <cstddef>

#include "harness/run/run_log.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// Sets the protocol use and the line mistakes of one client. Adds an event for the first of its commands whose values no server takes, and for
// the first of its other frames that are no message.
// `rate`: of the client's main line. An exchange, from one request to the next, is counted
// when it has ended.
void AddProtocolUse(RunLog& log, std::size_t client, const link::Protocol& protocol,
                    const link::LineRate& rate);

}  // namespace tiltproof::harness
