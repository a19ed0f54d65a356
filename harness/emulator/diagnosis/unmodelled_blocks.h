// The blocks of the chip that a firmware uses and that the emulated board does not model. It may do there what it would not
// do on a chip.
//
//   UnmodelledBlocks blocks;
//   if (const auto block = blocks.Take({0x4000'2850, true, pc}, source)) log(block->text);
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "harness/emulator/diagnosis/source_lines.h"

namespace tiltproof::harness {

class UnmodelledBlocks {
 public:
  struct Access {
    std::uint32_t address = 0;
    bool is_write = false;
    std::uint32_t pc = 0;
  };
  struct Block {
    std::string name;  // as in RM0090's memory map: "RTC"; where that has nothing, the address: "0x40008000"
    std::string text;  // what, and where in the firmware
  };
  // The block of the first access to it; nullopt for all others.
  std::optional<Block> Take(const Access& access, const SourceLines& source);

 private:
  std::set<std::string> names_;
};

}  // namespace tiltproof::harness
