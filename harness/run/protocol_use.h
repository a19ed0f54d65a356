// Counts how a client uses its protocol: what it sent, before any fault on the line, against what arrived at it.
// Whatever a protocol says, a client asks once a period, answers what it hears, and sends only its messages.
//
//   log.clients[0].protocol = UseOfProtocol(log.link, 0, *scenario.link.protocol, MainBaud(scenario.link));
#pragma once

#include <cstddef>

#include "harness/run/run_log.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// `baud`: of the client's main line; 0: bytes take no time. An exchange, from one request to the next, is counted
// when it has ended.
ProtocolUse UseOfProtocol(const LinkLog& link, std::size_t client, const link::Protocol& protocol,
                          std::int64_t baud);

}  // namespace tiltproof::harness
