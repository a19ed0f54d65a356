// Priorities, cycle counter, identity and core-coupled RAM.
#include "tests/emulator/registers/bare.h"

namespace {
unsigned order = 0;
void First() { order = order * 10 + 1; }
void Second() { order = order * 10 + 2; }
}  // namespace

void Test() {
  // 4 bits of priority (PM0214, section 4.3.7): bytes, and whole words.
  auto& byte = *reinterpret_cast<volatile std::uint8_t*>(0xE000E400 + 38);
  byte = 0xFF;
  Check("IPR byte", byte, 0xF0);
  Check("IPR word", Reg(0xE000E424), 0x00F00000);
  Reg(0xE000E424) = 0xFFFFFFFF;
  Check("IPR whole", Reg(0xE000E424), 0xF0F0F0F0);
  Reg(0xE000E424) = 0;
  // SHPR2 and SHPR3 (section 4.4.8).
  Reg(0xE000ED1C) = 0xFF000000;
  Check("SHPR2", Reg(0xE000ED1C), 0xF0000000);
  Reg(0xE000ED20) = 0xFFFF0000;
  Check("SHPR3", Reg(0xE000ED20), 0xF0F00000);

  // The more urgent one first: interrupts 28 and 29, both pending (ISPR, section 4.3.4).
  Handle(28, First);
  Handle(29, Second);
  *reinterpret_cast<volatile std::uint8_t*>(0xE000E400 + 28) = 0x60;
  *reinterpret_cast<volatile std::uint8_t*>(0xE000E400 + 29) = 0x50;
  asm volatile("cpsid i");
  Reg(0xE000E200) = Bit(28) | Bit(29);
  asm volatile("cpsie i\n\tisb");
  Check("order of priorities", order, 21);

  // Registers of the system control block that are not overlaid: CPUID (section 4.4.1), VTOR (4.4.4).
  Check("CPUID", Reg(0xE000ED00) >> 4, 0x410FC24);
  Reg(0xE000ED08) = 0x08000000;
  Check("VTOR", Reg(0xE000ED08), 0x08000000);

  // DWT_CYCCNT counts while DEMCR.TRCENA and its own bit are set.
  Check("DWT_CTRL", Reg(0xE0001000), 0x40000001);
  Reg(0xE0001004) = 0;
  const std::uint32_t begin = Cycles();
  Wait(100);
  CheckNear("CYCCNT", Cycles() - begin, 1'600, 50);
  Clear(0xE0001000, 1);
  const std::uint32_t stopped = Cycles();
  for (int i = 0; i < 1000; ++i) asm volatile("nop");
  Check("CYCCNT stands", Cycles(), stopped);
  Set(0xE0001000, 1);

  Check("DBGMCU_IDCODE", Reg(0xE0042000), 0x10076413);                                // section 38.6.1
  Check("flash size", *reinterpret_cast<volatile std::uint16_t*>(0x1FFF7A22), 1024);  // section 39.2
  Check("unique id", Reg(0x1FFF7A10) != 0 && Reg(0x1FFF7A10) != 0xFFFFFFFF, 1);       // section 39.1

  // Core-coupled RAM (section 2.3.1): 64 KB.
  Reg(0x10000000) = 0x12345678;
  Reg(0x1000FFFC) = 0x9ABCDEF0;
  Check("CCM begin", Reg(0x10000000), 0x12345678);
  Check("CCM end", Reg(0x1000FFFC), 0x9ABCDEF0);
}
