// Faults on the device: what is to happen to the firmware's processor, its memory or its clock, and when.
//
// Such a fault does not edit data. It is a command, and the part that runs the device carries it out, at the
// exact virtual time:
//
//   for (const DeviceCommand& command : DeviceCommands(scenario.faults, scenario.seed))
//     std::visit(Overloaded{[&](const ResetProcessor&) { ResetAt(command.at_ns); }, ...}, command.action);
//
// FlipBits has no addresses: the part that knows the firmware's image knows where the region is.
//
//   for (const BitFlip& flip : DrawBitFlips(flips, region.size_bytes))
//     memory[region.begin + flip.byte_offset] ^= 1U << flip.bit;
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "faults/clock_action.h"
#include "faults/fault.h"
#include "faults/parameters.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::faults {

struct ResetProcessor {};   // through its reset pin, and held until the end
struct ResetByWatchdog {};  // the same, with the watchdog as the reset cause
struct HangProcessor {};    // for good, or until a watchdog expires
struct StallProcessor {};   // until the end
struct DelayTask {          // each time from the begin on, until the end
  TimeNs delay_ns = 0;
  TimeNs every_ns = 0;
  TILTPROOF_FIELDS(delay_ns, every_ns)
};
struct SlowProcessor {  // computes so many times longer, until the end
  double factor = 1;
  TILTPROOF_FIELDS(factor)
};
struct FlipBits {
  std::string region;  // "ram", "data", "bss", "stack", or an object of the image
  std::int64_t bit_count = 0;
  std::uint64_t stream = 0;  // for DrawBitFlips()
  TILTPROOF_FIELDS(region, bit_count, stream)
};
using DeviceAction = std::variant<ResetProcessor, ResetByWatchdog, HangProcessor, StallProcessor, DelayTask,
                                  SlowProcessor, FlipBits, DriftClock, JumpClock>;

// The inputs from which an action is made.
struct DeviceSetup {
  const Parameters& parameters;
  std::uint64_t stream;  // key of the fault's random stream
};

struct DeviceCommand {
  TimeNs at_ns = 0;          // simulation time, not negative; drawn, where a bit flip has a window
  TimeNs until_ns = kNever;  // the processor runs again, the clock is right again; kNever: not reverted
  std::size_t fault = 0;     // index in the scenario's list
  DeviceAction action;
  TILTPROOF_FIELDS(at_ns, until_ns, fault, action)
};

// The commands of the faults on the device, including those on the client's clock, in order of time; at
// equal times in the order of the file. Throws std::invalid_argument, naming fault and key, when a fault is
// not valid.
std::vector<DeviceCommand> DeviceCommands(const std::vector<FaultSpec>& specs, std::uint64_t seed);

struct BitFlip {
  std::uint32_t byte_offset = 0;  // from the region's begin
  int bit = 0;                    // 0 to 7, 0 the least significant
  friend bool operator==(const BitFlip&, const BitFlip&) = default;
};

// `request.bit_count` different bits of `size_bytes`, uniformly distributed; a smaller count draws the first
// of these. Throws std::invalid_argument when there are not that many.
std::vector<BitFlip> DrawBitFlips(const FlipBits& request, std::uint32_t size_bytes);

}  // namespace tiltproof::faults
