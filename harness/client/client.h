// The firmware under test as the conductor sees it: bytes, times and a status, nothing else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "faults/device_command.h"
#include "faults/model.h"
#include "link/time.h"

namespace tiltproof::harness {

enum class Uart : std::uint8_t { kMain = 0, kReference = 1 };

struct ClientStatus {
  std::uint32_t supervisor_state = 0;
  std::uint32_t failsafe_count = 0;
};

// Kinds of DeviceEvent. The firmware boots anew: its processor was reset, or its process started again.
inline constexpr const char* kResetEvent = "device_reset";
// A line cannot work as it is set up: what a person should read when the flight never starts.
inline constexpr const char* kLineTroubleEvent = "line_trouble";
// Bytes that came while the one before had not been read.
inline constexpr const char* kOverrunEvent = "uart_overrun";

// Something that befell the board.
struct DeviceEvent {
  BootTime time_ns;
  std::optional<std::size_t> fault;  // that did it: its index in the scenario
  std::string kind;                  // kResetEvent, "bit_flipped", kOverrunEvent, ...
  std::string text;
  std::int64_t overruns_count = 0;  // of a kOverrunEvent: bytes lost
};

// What a client may call while it runs. Times are boot time.
struct ClientHost {
  std::function<BootTime(Uart uart, BootTime now, std::span<const std::uint8_t> bytes)> transmit;
  std::function<void(BootTime now, std::string_view text)> log;
  std::function<void(const DeviceEvent&)> event = [](const DeviceEvent&) {};
};

// Lockstep (see firmware/tiltproof_client.h for the rules).
class Client {
 public:
  virtual ~Client() = default;

  // A client that acts only when it is called (a library) is called at the instant at which something arrives or
  // its time has come. One with a processor of its own (an emulator) runs on between its calls: it is given bytes
  // ahead of time, as soon as their arrival is certain, and so is each at its own time at its pin.
  virtual bool RunsOn() const { return false; }

  // Power-on. Returns until when the client waits.
  virtual BootTime Start(BootTime now) = 0;
  // Bytes, back to back, the last of which arrives at `arrival`. `marks` is empty, or says of each what the
  // receiver makes of it.
  virtual void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
                       std::span<const faults::ReceiveMark> marks) = 0;
  // Runs the client at `now`; one that runs on, from there to `horizon` at most, or until it has transmitted what
  // may be answered. Returns until when it waits.
  virtual BootTime Grant(BootTime now, BootTime horizon) = 0;
  // What the faults on the board do, told once when t = 0 is known; a Grant() follows. Throws
  // std::runtime_error for a command that makes no sense with this firmware (a region that its image does not have).
  virtual void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) = 0;
  virtual std::optional<ClientStatus> Status() = 0;
};

}  // namespace tiltproof::harness
