// A firmware image of 30 instructions for tests of the emulator: it counts the ticks of a timer of 1 ms, and sleeps.
//
//   WriteTickImage(file);   // the count is a word at kTickCountAddress
#pragma once

#include <elf.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "tests/harness/emulator/elf_header.h"

namespace tiltproof::harness {

inline constexpr std::uint32_t kTickCountAddress = 0x2000'0100;

// Assembled from:
//   reset:   ldr r0, =0xE000E010   (SysTick)      systick: ldr r2, =0x20000100
//            ldr r1, =167999                               ldr r1, [r2]
//            str r1, [r0, #4]      (reload)                adds r1, #1
//            movs r1, #0                                   str r1, [r2]
//            str r1, [r0, #8]                              bx lr
//            ldr r2, =0x20000100
//            str r1, [r2]
//            movs r1, #7           (processor clock, interrupt, on)
//            str r1, [r0]
//   loop:    wfi
//            b loop
inline constexpr std::array<std::uint16_t, 24> kTickCode = {
    0x4808, 0x4909, 0x6041, 0x2100, 0x6081, 0x4a08, 0x6011, 0x2107, 0x6001, 0xbf30, 0xe7fd, 0xbf00,
    0x4a04, 0x6811, 0x3101, 0x6011, 0x4770, 0xbf00, 0xe010, 0xe000, 0x903f, 0x0002, 0x0100, 0x2000};

// An executable for the machine: a vector table and code at the start of flash. `reset`: where it begins; an even
// address is no Thumb code, and locks the processor up at once.
inline void WriteImage(const std::filesystem::path& file, std::uint32_t reset) {
  constexpr std::uint32_t kFlashAt = 0x0800'0000, kCode = 64, kTickHandler = kFlashAt + kCode + 24;
  std::array<std::uint32_t, 16> vectors{};
  vectors[0] = 0x2002'0000;  // stack
  vectors[1] = reset;
  vectors[15] = kTickHandler | 1;

  Elf32_Ehdr header = ArmExecutable();
  header.e_entry = reset;
  header.e_phoff = sizeof header;
  header.e_phnum = 1;
  Elf32_Phdr segment{};
  segment.p_type = PT_LOAD;
  segment.p_offset = sizeof header + sizeof segment;
  segment.p_vaddr = segment.p_paddr = kFlashAt;
  segment.p_filesz = segment.p_memsz = sizeof vectors + sizeof kTickCode;
  segment.p_flags = PF_R | PF_X;
  segment.p_align = 4;

  std::ofstream out(file, std::ios::binary);
  const auto write = [&](const auto& value) {
    out.write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  write(header);
  write(segment);
  write(vectors);
  write(kTickCode);
}

inline void WriteTickImage(const std::filesystem::path& file) { WriteImage(file, 0x0800'0041); }
inline void WriteLockupImage(const std::filesystem::path& file) { WriteImage(file, 0x0800'0040); }

}  // namespace tiltproof::harness
