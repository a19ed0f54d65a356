// Explains why a firmware on an emulated board does not go on: its place, its fault, its awaited event, its sent
// bytes. For the flight's reason in one line, and at length for its log.
//
//   const Findings found = Examine(board, symbols, source, roles, Condition::kBusy);
//   HangText(found, 2 * kNsPerS, "t = 1.203 s");
//
// Examine() runs the firmware on for a few microseconds, one instruction at a time, unless it is locked up. So it
// sees what the firmware reads again and again.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "harness/emulator/diagnosis/cpu_state.h"
#include "harness/emulator/diagnosis/source_lines.h"
#include "harness/emulator/diagnosis/stopped_board.h"
#include "harness/emulator/elf_symbols.h"
#include "link/time.h"

namespace tiltproof::harness {

struct UsartRoles {
  int main = 0, reference = 0, console = 0;  // numbers of USARTs; 0: none
};

// State of the processor at the end.
enum class Condition : std::uint8_t {
  kBusy,      // neither sleeps nor sends
  kLockedUp,  // past all help
  kSleeps,    // as far as one knows: it may be at work, too
};

struct Findings {
  std::string reason;              // in one line
  std::vector<std::string> lines;  // at length
  bool in_fault_handler = false;
};

Findings Examine(StoppedBoard& board, const ElfSymbols& symbols, const SourceLines& source,
                 const UsartRoles& roles, Condition condition);

// The same words for lockstep and for real time. `since`, `at`: as a user reads a time.
std::string HangText(const Findings& found, TimeNs silent_ns, const std::string& since);
// Text for a firmware that makes the emulator compute longer than it may, `cost_ns` of processor time for `span_ns`.
std::string CostText(const Findings& found, TimeNs cost_ns, TimeNs span_ns, const std::string& since,
                     TimeNs limit_ns_per_s);
std::string CrashText(const Findings& found, const std::string& at);

// Describes a firmware that was reset by itself or its watchdog: the fault that it has taken, if any, and its place.
std::string ExplainReset(const lockstep::LastWords& words, std::string_view registers,
                         const SourceLines& source);

// Where the processor is: "ReadSensor (main.c:123), LR in main (main.c:200)", or a handler's name instead of LR.
std::string Position(const SourceLines& source, const CpuState& state);

// Output and settings of its USARTs, in one line: the main one, and others that have sent something
// although nothing is connected to them.
std::string UsartSummary(StoppedBoard& board, const UsartRoles& roles);

}  // namespace tiltproof::harness
