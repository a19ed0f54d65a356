// Checks before the flight that an image can run on an STM32F405 at all: an image that cannot is not a firmware
// that crashed.
//
//   CheckImage("firmware.elf");         // throws std::runtime_error: what is wrong, and what to do
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "harness/emulator/elf_file.h"

namespace tiltproof::harness {

// The first two words of the vector table (ARMv7-M ARM, section B1.5.3).
struct VectorTable {
  std::uint32_t address = 0;
  std::uint32_t stack_pointer = 0;
  std::uint32_t reset = 0;
};

// At the start of flash, where the processor looks for it (RM0090, section 2.4). Nullopt when the image holds
// nothing there.
std::optional<VectorTable> FindVectorTable(const ElfFile& image);

// Throws std::runtime_error when the file is not a whole executable for a Cortex-M4F that lies in the memories
// of an STM32F405 and begins with a vector table. Build attributes are those of the "Addenda to, and Errata in,
// the ABI for the Arm Architecture", section 3; an image without them is taken as it is.
void CheckImage(const std::filesystem::path& file);

}  // namespace tiltproof::harness
