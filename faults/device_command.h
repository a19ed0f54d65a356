// Faults on the device: what is to happen to the firmware's processor, its memory or its clock, and when.
//
// Such a fault edits nothing that passes. It is a command, and who runs the device carries it out, at the
// exact virtual time:
//
//   FaultSchedule faults(scenario.faults, scenario.seed);
//   for (const DeviceCommand& command : DeviceCommands(scenario.faults, scenario.seed)) {
//     At(command.at_ns, [&] { Reset(...); faults.Count(command.fault, now, "reset"); });
//   }
//
// Of a bit flip the command has no addresses: who knows the firmware's image knows where the region lies.
//
//   for (const BitFlip& flip : DrawBitFlips(command.bits_stream, region.size, command.parameters.Integer("bit_count")))
//     memory[region.begin + flip.byte_offset] ^= 1U << flip.bit;
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "faults/fault.h"
#include "faults/model.h"
#include "link/time.h"

namespace tiltproof::faults {

struct DeviceCommand {
  TimeNs at_ns = 0;          // simulation time, not negative; drawn, where a bit flip has a window
  TimeNs until_ns = kNever;  // the processor runs again, the clock is right again; kNever: not taken back
  std::size_t fault = 0;     // index in the scenario's list
  std::string type;          // "device.stall"
  Parameters parameters;     // of the type, defaults filled in
  std::uint64_t bits_stream = 0;  // device.bit_flip: for DrawBitFlips()
};

// Those of the faults that are on the device, in order of time, at the same time in the order of the file.
// Throws std::invalid_argument, naming fault and key, when a fault is not valid.
std::vector<DeviceCommand> DeviceCommands(const std::vector<FaultSpec>& specs, std::uint64_t seed);

struct BitFlip {
  std::uint32_t byte_offset = 0;  // from the region's begin
  int bit = 0;                    // 0 to 7, 0 the least significant
  friend bool operator==(const BitFlip&, const BitFlip&) = default;
};

// `bit_count` bits of `size_bytes`, all different, every choice alike; a smaller count draws the first of
// these. Throws std::invalid_argument when there are not that many.
std::vector<BitFlip> DrawBitFlips(std::uint64_t bits_stream, std::uint32_t size_bytes,
                                  std::int64_t bit_count);

}  // namespace tiltproof::faults
