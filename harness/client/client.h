// The firmware under test, as the conductor sees it: bytes, times and a status, nothing else.
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
#include "harness/client/coverage.h"
#include "harness/client/firmware_end.h"
#include "harness/client/stack_use.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

// From kFirstLine on: the lines to other boards (Scenario::line_ends_of()).
enum class Uart : std::uint8_t { kMain = 0, kReference = 1, kFirstLine = 2 };
constexpr Uart LineUart(std::size_t line_end) {
  return static_cast<Uart>(static_cast<std::size_t>(Uart::kFirstLine) + line_end);
}

struct ClientStatus {
  std::uint32_t supervisor_state = 0;
  std::uint32_t failsafe_count = 0;
  TILTPROOF_FIELDS(supervisor_state, failsafe_count)
};

// A client's values in each row of the trace.
struct ClientSample {
  std::optional<std::uint32_t> supervisor_state;  // none: it tells none
  std::vector<double>
      watched;  // the variables that the scenario watches, in its order; a client without an image has none
  std::optional<std::uint32_t> role = {};  // among several clients; none: it tells none
  TILTPROOF_FIELDS(supervisor_state, watched, role)
};

// Kinds of DeviceEvent. The firmware reboots: its processor was reset, or its process was restarted.
inline constexpr const char* kResetEvent = "device_reset";
// A line cannot work as it is configured: an explanation for the user when the flight never starts.
inline constexpr const char* kLineTroubleEvent = "line_trouble";
// State of the processor of a firmware that never started: an explanation, too. Also reported when the processor is in
// the handler of a fault at the flight's end.
inline constexpr const char* kBoardStateEvent = "board_state";
// The path between a board and the harness uses half of the loop's delay margin: an explanation when the flight fails.
inline constexpr const char* kSlowAdapterEvent = "slow_adapter";
// The firmware uses a block of the chip that the emulated board does not model: an explanation when the flight fails.
inline constexpr const char* kUnmodelledEvent = "unmodelled_block";
// The firmware's stack pointer left a stack at its lower end: an explanation when the flight fails.
inline constexpr const char* kStackOverflowEvent = "stack_overflow";
// The use of the stacks when the flight is over. The client's record keeps it, and the events of the flight do not.
inline constexpr const char* kStackUseEvent = "stack_use";
// The firmware states its computing time for the first time; and each computation that ends after its deadline.
inline constexpr const char* kComputesEvent = "computing_stated";
inline constexpr const char* kDeadlineMissedEvent = "deadline_missed";
// Bytes that arrived before the previous byte had been read.
inline constexpr const char* kOverrunEvent = "uart_overrun";

// An event on the board.
struct DeviceEvent {
  BootTime time_ns;
  std::optional<std::size_t> fault;  // the fault that caused it: its index in the scenario
  std::string kind;                  // kResetEvent, "bit_flipped", kOverrunEvent, ...
  std::string text;
  std::int64_t overruns_count = 0;    // for a kOverrunEvent: bytes lost
  std::string block = {};             // for a kUnmodelledEvent: its name
  std::vector<StackUse> stacks = {};  // for a kStackUseEvent
  TILTPROOF_FIELDS(time_ns, fault, kind, text, overruns_count, block, stacks)
};

// Functions that a client may call while it runs. Times are boot time.
struct ClientHost {
  std::function<BootTime(Uart uart, BootTime now, std::span<const std::uint8_t> bytes)> transmit;
  std::function<void(BootTime now, std::string_view text)> log;
  std::function<void(const DeviceEvent&)> event = [](const DeviceEvent&) {};
  bool models_computing = true;  // false: in real time, where computing takes the time that it takes
};

// Lockstep (see firmware/tiltproof_client.h for the rules).
class Client {
 public:
  virtual ~Client() = default;

  // A client that acts only when it is called (a library) is called when bytes arrive or its wake-up time is
  // reached. A client with its own processor (an emulator) runs on between its calls. It receives bytes ahead
  // of time, as soon as their arrival is certain, so that each byte reaches its pin at its own time.
  virtual bool RunsOn() const { return false; }

  // Powers the client on. Returns until when the client waits.
  virtual BootTime Start(BootTime now) = 0;
  // Bytes, back to back, the last of which arrives at `arrival`. `marks` is empty, or says for each byte how
  // the receiver treats it.
  virtual void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
                       std::span<const faults::ReceiveMark> marks) = 0;
  // Runs the client at `now`. A client that runs on runs from there to `horizon` at most, or until it has
  // transmitted a byte that may be answered. Returns until when it waits.
  virtual BootTime Grant(BootTime now, BootTime horizon) = 0;
  // Tells the client what the faults on the board do, once, when t = 0 is known; a Grant() follows. Throws
  // std::runtime_error for a command that makes no sense with this firmware (a region that its image does not
  // have).
  virtual void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) = 0;
  // More of them, after Command(), which begin at the present time or later; none is of a clock where the client runs on.
  // Returns until when the client waits.
  virtual BootTime Add(const std::vector<faults::DeviceCommand>& commands) = 0;
  virtual std::optional<ClientStatus> Status() = 0;
  // At the client's present time, between two calls of Grant().
  virtual ClientSample Sample() = 0;
  // Ends the firmware in order when its flight is over, as the destructor does otherwise. Returns how that went wrong; none: it
  // did not.
  virtual std::optional<FirmwareTrouble> End() { return std::nullopt; }
  // Since its power-on, when it was made to tell; also after the flight.
  virtual Coverage CodeCoverage() { return {}; }
};

}  // namespace tiltproof::harness
