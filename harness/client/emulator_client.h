// The firmware as an unmodified image on an emulated board, in lockstep: `--client qemu`.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/client/client.h"
#include "harness/emulator/emulator_process.h"
#include "link/character.h"

namespace tiltproof::harness {

struct EmulatorLines {
  link::LineRate main, reference;
  // To other boards, the UARTs from 2 on: the line's id, and its rate.
  struct Between {
    std::string id;
    link::LineRate rate;
  };
  std::vector<Between> between = {};
  bool faulty = false;  // there are faults that change what passes, or when
};

// `break_at_ns`: simulation time at which the machine stops for a debugger.
// Throws std::runtime_error when there is no such image or plug-in or the emulator does not start. During the
// flight, a board that crashes or never sleeps is FirmwareTrouble; before its `start` it may be busy for
// `start_within_ns`. `watch`: names of variables (harness/emulator/diagnosis/watched_variable.h).
std::unique_ptr<Client> StartEmulatorClient(const EmulatorSpec& spec, const EmulatorLines& lines,
                                            TimeNs start_within_ns, const std::vector<std::string>& watch,
                                            std::optional<TimeNs> break_at_ns, ClientHost host);

}  // namespace tiltproof::harness
