// When the client booted anew and when it asked for sensors, from what the flight's log holds of its line and its
// device.
//
//   AddClientHistory(log, 0, *scenario.link.protocol, BootSign::kReset);   // once log is whole and in order of time
#pragma once

#include "harness/run/run_log.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// How a new boot of the client shows.
enum class BootSign : std::uint8_t {
  kReset,  // who runs the client tells it (harness/client/client.h)
  // By a `start` that it sends after its first accepted actuator message; before that one it may only be repeating
  // itself. A `start` that a fault copied on the line does not count: the client did not send it.
  kStart,
};

// Sets the restarts and sent_request_times_ns of one client.
void AddClientHistory(RunLog& log, std::size_t client, const link::Protocol& protocol, BootSign sign);

// What is wrong with the client's lines, as far as the events tell, goes into the reason of a flight that never started.
void ExplainNeverStarted(RunLog& log);

}  // namespace tiltproof::harness
