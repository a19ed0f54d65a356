// Stacks of a firmware on the emulated board: those that its image delimits.
//
//   const std::vector<ImageStack> stacks = StacksOf(symbols);
#pragma once

#include <cstdint>
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

}  // namespace tiltproof::harness
