// A client that acts only when it is called: a library, or a program that answers messages. What both have in common is
// here: its clock, which a fault may falsify, the resets and delays that faults command, and its output.
//
//   BootTime WakeOf(CalledClient& client, BootTime now) {
//     return client.Grant(now, now);   // calls RunFirmware() at what its clock shows, unless it is held
//   }
#pragma once

#include <deque>
#include <span>
#include <string>
#include <vector>

#include "harness/client/client.h"
#include "harness/client/computing_time.h"
#include "harness/client/device_clock.h"
#include "harness/client/sanitizer.h"
#include "harness/client/task_delays.h"

namespace tiltproof::harness {

class CalledClient : public Client {
 public:
  explicit CalledClient(ClientHost host) : host_(std::move(host)) {}

  BootTime Start(BootTime now) final;
  void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> marks) final;
  BootTime Grant(BootTime now, BootTime horizon) final;
  // It can be reset or run late, and its clock can be wrong; all other faults of a device are refused before the flight.
  void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) final;
  BootTime Add(const std::vector<faults::DeviceCommand>& commands) final;
  std::optional<ClientStatus> Status() final;
  ClientSample Sample() final;

 protected:
  // Calls into the firmware, at what its clock shows. Those with a result return until when it waits.
  virtual TimeNs StartFirmware(TimeNs shown) = 0;
  virtual void ReceiveInFirmware(Uart uart, TimeNs shown, std::span<const std::uint8_t> bytes) = 0;
  virtual TimeNs RunFirmware(TimeNs shown) = 0;
  virtual TimeNs ResetFirmware(TimeNs shown) = 0;
  virtual std::optional<ClientStatus> AskStatus() = 0;
  virtual std::optional<std::uint32_t> AskRole() = 0;
  // Passes complete lines of its output to LogLine(), or also what has no end yet.
  virtual void TakeOutput(bool all) = 0;

  // The firmware computes: firmware/tiltproof_client.h, TiltproofHost.compute. All times are of its clock, and may be
  // anything.
  TimeNs Compute(TimeNs shown, TimeNs length_ns, TimeNs deadline);

  const ClientHost& host() const { return host_; }
  const DeviceClock& clock() const { return clock_; }
  AbortReport& report() { return report_; }  // in its output
  const AbortReport& report() const { return report_; }

  // Writes to the log what it has printed by now, or all of it when it has ended.
  void LogOutput(BootTime now);
  void LogAllOutput() { TakeOutput(true); }
  void LogLine(const std::string& line);

 private:
  struct Reset {
    BootTime begin, end;
    std::size_t fault;
  };
  BootTime Run(BootTime now);
  BootTime WaitsFor(TimeNs shown);
  BootTime Next() const;

  ClientHost host_;
  AbortReport report_;
  std::deque<Reset> resets_;              // to come, by begin
  DeviceClock clock_;                     // by which it lives; all other times here are true
  std::deque<DeviceEvent> clock_events_;  // to be reported when they happen, in order
  TaskDelays task_delays_;
  SlowSpans slow_spans_;
  bool states_computing_ = false;
  BootTime called_ns_;  // the last call
  BootTime task_held_until_;
  bool in_reset_ = false;
  BootTime held_until_;
  BootTime wake_ns_ = BootTime::Never();
  std::optional<TimeNs> wake_shown_;  // by its clock, while it is the firmware that waits
  Origin origin_;
  BootTime logged_ns_;
};

}  // namespace tiltproof::harness
