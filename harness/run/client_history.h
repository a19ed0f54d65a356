// Finds when the client rebooted and when it asked for sensors, from the flight's log of its line and its
// device.
//
//   AddClientHistory(log, 0, *scenario.link.protocol);   // once log is whole and in order of time
#pragma once

#include "harness/run/run_log.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// Sets the restarts and sent_request_times_ns of one client. A restart is a new boot:
// - a reset that the client's runner reports (kResetEvent), from t = 0 on;
// - a `start` that the client sends after its first accepted actuator message, where the protocol has it so
//   (Protocol::repeated_start_is_boot). The first one after a reset belongs to that reset. One that is repeated
//   before the client has sent actuators is a retry. A `start` that a fault copied on the line does not count,
//   because the client did not send it.
void AddClientHistory(RunLog& log, std::size_t client, const link::Protocol& protocol);

// Adds to the reason of a flight that never started what arrived at the server instead, and what is wrong with the
// client's lines, as far as the events tell.
void ExplainNeverStarted(RunLog& log, const link::Protocol& protocol);

}  // namespace tiltproof::harness
