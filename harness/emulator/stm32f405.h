// The STM32F405 by address: its memories, and the names of its peripherals and their registers, for messages
// that a person reads.
//
//   RegisterName(0x4002'3800);                    // "RCC_CR"
//   RegisterName(0x4000'7404);                    // "DAC + 0x4": a block whose registers are not listed
//   Holds(kFlash, 0x0800'0000);                   // true
//
// Sources: RM0090 (STM32F405/407 reference manual), table 1 and the register maps at the end of its sections;
// PM0214 (Cortex-M4 programming manual), section 4.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace tiltproof::harness {

struct MemoryRegion {
  std::uint32_t address = 0;
  std::uint32_t size_bytes = 0;  // at least 1
  friend bool operator==(const MemoryRegion&, const MemoryRegion&) = default;
};

// RM0090, sections 2.3 and 2.4.
inline constexpr MemoryRegion kFlash = {.address = 0x0800'0000, .size_bytes = 1024 * 1024};
inline constexpr MemoryRegion kFlashAtZero = {.address = 0,
                                              .size_bytes = 1024 * 1024};  // the same, seen at 0
inline constexpr MemoryRegion kRam = {.address = 0x2000'0000, .size_bytes = 128 * 1024};
inline constexpr MemoryRegion kCoreCoupledRam = {.address = 0x1000'0000, .size_bytes = 64 * 1024};

constexpr bool Holds(const MemoryRegion& region, std::uint64_t address, std::uint64_t size_bytes = 1) {
  return address >= region.address &&
         address + size_bytes <= std::uint64_t{region.address} + region.size_bytes;
}

// A stack grows downwards, so its pointer may begin just behind a RAM.
constexpr bool IsStackPointer(std::uint32_t value) {
  return value % 4 == 0 &&
         (Holds(kRam, std::uint64_t{value} - 4, 4) || Holds(kCoreCoupledRam, std::uint64_t{value} - 4, 4));
}

// The emulation of an address of the board.
enum class Emulated : std::uint8_t {
  kYes,
  kReadsZero,  // QEMU maps it; it reads 0 and ignores what is written
  kNo,         // an access is a bus fault
};

struct Peripheral {
  std::string_view name;
  std::uint32_t address = 0, size_bytes = 0;
  Emulated emulated = Emulated::kNo;
  bool on_chip = true;  // false: of larger members of the family (STM32F407, F415, F42x)
};

// Null when nothing is there.
const Peripheral* FindPeripheral(std::uint32_t address);
// The emulation of this one register: of RCC, only CSR is there.
Emulated EmulationOf(std::uint32_t address);

// "" where no peripheral is.
std::string RegisterName(std::uint32_t address);

// Where an address lies, in words: "flash", "RAM", "USART2_SR", "no memory".
std::string PlaceName(std::uint32_t address);

}  // namespace tiltproof::harness
