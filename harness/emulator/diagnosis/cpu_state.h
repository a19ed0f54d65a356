// The registers of the emulated Cortex-M4, and what an instruction that reads memory is about to read.
//
//   const auto state = ParseCpuState(board.Registers());
//   if (state && state->exception() == 3) ...                // in the hard fault's handler
//   LoadAddress(*state, code);                               // of `ldr r2, [r3, #4]`: r3 + 4
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tiltproof::harness {

struct CpuState {
  std::array<std::uint32_t, 16> r{};  // R13: stack pointer, R14: link register, R15: the next instruction
  std::uint32_t xpsr = 0;

  std::uint32_t stack_pointer() const { return r[13]; }
  std::uint32_t link() const { return r[14]; }
  std::uint32_t pc() const { return r[15]; }
  // The exception being handled, 0 for none (IPSR: ARMv7-M ARM, section B1.4.2).
  int exception() const { return static_cast<int>(xpsr & 0x1FFU); }
  // In the handler of a fault, or of an NMI.
  bool InFaultHandler() const { return exception() >= 2 && exception() <= 6; }
  friend bool operator==(const CpuState&, const CpuState&) = default;
};

// From QEMU's dump of registers ("R00=00000000 ... XPSR=01000003 ..."), anywhere in a text. Nullopt when one is
// missing.
std::optional<CpuState> ParseCpuState(std::string_view text);

// "the hard fault's handler", "the handler of interrupt 38"; "" for thread mode.
std::string HandlerName(int exception);

// The address that the instruction reads when it loads a register from memory by a base register and an offset;
// nullopt for all others, loads relative to PC and SP among them. `code`: its two half-words, the first below
// (ARMv7-M ARM, sections A5.2.4, A5.3.7 to A5.3.9).
std::optional<std::uint32_t> LoadAddress(const CpuState& state, std::uint32_t code);

}  // namespace tiltproof::harness
