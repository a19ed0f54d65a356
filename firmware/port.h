// The flight firmware's interface to the board it runs on: two transmitters and a log. Everything else is
// passed in.
//
// The firmware never reads a clock and never waits. The owner of the board calls FlightApplication with the
// time, and gives it the bytes that its receivers got. A new port (another board, another operating system)
// implements this class and that loop.
#pragma once

#include <cstdint>
#include <span>

#include "link/time.h"

namespace tiltproof::firmware {

enum class Uart : std::uint8_t {
  kMain = 0,       // sensors and actuators: the paper's service protocol
  kReference = 1,  // references from the base station or the joystick reader: frame layer only
  kCross = 2,      // to another board on the vehicle (firmware/failover/cross_line.h)
  kSecondCross = 3
};

class Port {
 public:
  // Gives bytes to the transmitter at `now`; they leave back to back after those that it still holds. Returns
  // the time at which the last stop bit will have left (`now` on a line without byte time). `bytes` need not
  // stay valid after the call.
  virtual TimeNs Transmit(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) = 0;

  // One line for a person, without line end. May drop it.
  virtual void Log(TimeNs now, const char* text) = 0;

 protected:
  ~Port() = default;  // never owned through this interface
};

}  // namespace tiltproof::firmware
