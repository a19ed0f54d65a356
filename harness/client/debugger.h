// A debugger at the firmware: the flight waits for it, at power-on or at a time of the flight. Simulation time stands still
// meanwhile, so a flight that is debugged is the same as one that is not.
//
//   const DebugStop stop{.port = 1234, .at_ns = 2 * kNsPerS};
//   const std::string command = HowToDebugImage("firmware.elf", stop);   // for a person to type
//
// An emulated processor is debugged through QEMU's gdb server. A library is debugged in its process.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "harness/client/client.h"
#include "link/time.h"

namespace tiltproof::harness {

struct DebugStop {
  static constexpr int kPort = 1234;
  int port = kPort;             // of QEMU's gdb server on this machine; a library has none
  std::optional<TimeNs> at_ns;  // simulation time; none: at power-on, before the first instruction
};

// The command to type, for a person. `image`: of an emulated processor.
std::string HowToDebugImage(const std::string& image, const DebugStop& stop);
// The same for a library in this process.
std::string HowToDebugLibrary(const DebugStop& stop);

// The client of a library, which waits for a debugger at that time.
std::unique_ptr<Client> WaitForDebugger(std::unique_ptr<Client> library, const DebugStop& stop);

}  // namespace tiltproof::harness
