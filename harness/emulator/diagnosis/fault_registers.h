// The fault registers of a Cortex-M4, in words (ARMv7-M ARM, sections B3.2.15 to B3.2.18; PM0214, sections
// 4.4.13 to 4.4.18).
//
//   FaultText({.cfsr = 0x8200, .bfar = 0x6000'0000});    // "bus fault: precise data access to 0x60000000 (no memory)"
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "harness/emulator/diagnosis/cpu_state.h"

namespace tiltproof::harness {

// In the order of their addresses, with DFSR between the second and the third.
struct FaultRegisters {
  std::uint32_t cfsr = 0, hfsr = 0, mmfar = 0, bfar = 0;
  bool Any() const { return cfsr != 0 || hfsr != 0; }
};
inline constexpr std::uint32_t kFaultRegisters = 0xE000'ED28;

// One phrase for each flag that is set, the likely cause first; "" when none is.
std::string FaultText(const FaultRegisters& registers);

// Registers that an exception pushes on the stack (ARMv7-M ARM, section B1.5.6).
struct ExceptionFrame {
  std::uint32_t address = 0;
  std::uint32_t r0 = 0, r1 = 0, r2 = 0, r3 = 0, r12 = 0, link = 0, pc = 0, xpsr = 0;
  // The number of the exception whose handler was interrupted, or 0.
  int exception() const { return static_cast<int>(xpsr & 0x1FFU); }
};

// True if a handler with this in its link register has interrupted code on the process stack (PSP). An RTOS's tasks
// use that stack (ARMv7-M ARM, table B1-8).
bool ReturnsToProcessStack(std::uint32_t link);

using ReadWords = std::function<std::vector<std::uint32_t>(std::uint32_t address, std::uint32_t count)>;

// The frames of the exception that is being handled and of those that it interrupted, the last exception's first. One is at the stack pointer when the handler has pushed nothing.
// Otherwise it is the first above it that can be one: Thumb state, and a PC in code. What was pushed on the other
// stack is not found.
std::vector<ExceptionFrame> FindExceptionFrames(const CpuState& state, const ReadWords& read);

}  // namespace tiltproof::harness
