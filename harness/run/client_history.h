// Finds when the client rebooted and when it asked for sensors, from the flight's log of its line and its
// device.
//
//   AddClientHistory(log, 0, *scenario.link.protocol, BootSign::kReset);   // once log is whole and in order of time
#pragma once

#include "harness/run/run_log.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// How a reboot of the client is recognised.
enum class BootSign : std::uint8_t {
  kReset,  // the client's runner reports it (harness/client/client.h)
  // By a `start` that the client sends after its first accepted actuator message. An earlier one may be a
  // repetition. A `start` that a fault copied on the line does not count: the client did not send it.
  kStart,
};

// Sets the restarts and sent_request_times_ns of one client.
void AddClientHistory(RunLog& log, std::size_t client, const link::Protocol& protocol, BootSign sign);

// Adds to the reason of a flight that never started what arrived at the server instead, and what is wrong with the
// client's lines, as far as the events tell.
void ExplainNeverStarted(RunLog& log, const link::Protocol& protocol);

}  // namespace tiltproof::harness
