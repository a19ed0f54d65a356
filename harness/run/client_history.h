// Finds when the client rebooted and when it asked for sensors, from what it sends and from the events of its device.
//
//   ClientHistory history(*scenario.link.protocol);
//   history.Receive(time_ns, bytes);   // all that the client sends, in its order
//   history.AddTo(log, 0);             // once log is whole and in order of time
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "harness/run/message_receiver.h"
#include "harness/run/run_log.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// The restarts and sent_request_times_ns of one client. A restart is a new boot:
// - a reset that the client's runner reports (kResetEvent), from t = 0 on;
// - a `start` that the client sends after its first accepted actuator message, where the protocol has it so
//   (Protocol::repeated_start_is_boot). The first one after a reset belongs to that reset. One that is repeated
//   before the client has sent actuators is a retry. A `start` that a fault copied on the line does not count,
//   because the client did not send it.
class ClientHistory {
 public:
  // A sign of the client's boots.
  struct Sign {
    TimeNs time_ns = 0;
    enum Kind : std::uint8_t { kReset, kStart, kActuators } kind = kReset;
    std::string text;
  };

  // `protocol` must outlive it.
  explicit ClientHistory(const link::Protocol& protocol);

  // `bytes`: as the client sent them, before any fault on its line.
  void Receive(TimeNs begin_ns, std::span<const std::uint8_t> bytes);
  void AddTo(RunLog& log, std::size_t client) const;

 private:
  const link::Protocol& protocol_;
  MessageReceiver receiver_;
  std::vector<TimeNs> requests_ns_;
  std::vector<Sign> signs_;  // without resets
};

// Adds to the reason of a flight that never started what arrived at the server instead, and what is wrong with the
// client's lines, as far as the events tell.
void ExplainNeverStarted(RunLog& log, const link::Protocol& protocol);

}  // namespace tiltproof::harness
