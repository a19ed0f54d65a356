// Stacks of a firmware on the emulated board: those that its image delimits, and the use of each one, by what was written and
// what was reserved.
//
//   const std::vector<ImageStack> stacks = StacksOf(symbols);
//   const std::uint32_t used_bytes = UsedBytes(content, lowest_pointer - stack.region.address);
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/stm32f405.h"

namespace tiltproof::harness {

struct ImageStack {
  std::string name;  // `main`, or the variable's
  MemoryRegion region;
};

// `main`, from the initial stack pointer down to the symbol _sstack, __StackLimit, __stack_limit or __main_stack_base__, or as
// large as the symbol _Min_Stack_Size says. Then, by address, each variable in RAM with `stack` in its name, in any case:
// tasks' stacks, and what is none, which the stack pointer never enters. At most lockstep::kWatchedStacksMax.
std::vector<ImageStack> StacksOf(const ElfSymbols& symbols);

// Bytes at the high end of a stack that have been used. `content`: of the whole stack. Its lowest words hold what it was
// filled with before (0, or four equal bytes as RTOSes paint), and the first other word has been written.
// `lowest_offset`: of the lowest stack pointer, which may have reserved more than was written.
std::uint32_t UsedBytes(std::span<const std::uint8_t> content, std::uint32_t lowest_offset);

}  // namespace tiltproof::harness
