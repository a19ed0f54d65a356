// RCC (section 7.3) and what the clock tree gives to the core and the timers (section 7.2).
#include "tests/emulator/registers/bare.h"

namespace {

constexpr std::uint32_t kRcc = 0x40023800, kCr = kRcc, kPllcfgr = kRcc + 4, kCfgr = kRcc + 8,
                        kCsr = kRcc + 0x74;

// Increase of a counter's reading in 10 000 cycles of the core; a counter that counts down is inverted by its reader.
template <class Counter>
std::uint32_t CountIn(const Counter& counter) {
  const std::uint32_t begin = Cycles(), count = counter();
  while (Cycles() - begin < 10'000) {
  }
  return counter() - count;
}

// A register of a block with its reset value, and the block's bit in an xxxENR.
struct Block {
  const char *without, *with;
  std::uint32_t enable;
  unsigned bit;
  std::uint32_t address, value;
};
constexpr Block kBlocks[] = {{"GPIOA without clock", "GPIOA_MODER", kRcc + 0x30, 0, 0x40020000, 0xA8000000},
                             {"DMA1 without clock", "DMA1_S0FCR", kRcc + 0x30, 21, 0x40026024, 0x21},
                             {"DMA2 without clock", "DMA2_S0FCR", kRcc + 0x30, 22, 0x40026424, 0x21},
                             {"TIM2 without clock", "TIM2_ARR", kRcc + 0x40, 0, 0x4000002C, 0xFFFFFFFF},
                             {"TIM14 without clock", "TIM14_ARR", kRcc + 0x40, 8, 0x4000202C, 0xFFFF},
                             {"USART2 without clock", "USART2_SR", kRcc + 0x40, 17, 0x40004400, 0xC0},
                             {"UART5 without clock", "UART5_SR", kRcc + 0x40, 20, 0x40005000, 0xC0},
                             {"PWR without clock", "PWR_CR", kRcc + 0x40, 28, 0x40007000, 0x4000},
                             {"TIM1 without clock", "TIM1_ARR", kRcc + 0x44, 0, 0x4001002C, 0xFFFF},
                             {"USART6 without clock", "USART6_SR", kRcc + 0x44, 5, 0x40011400, 0xC0},
                             {"TIM11 without clock", "TIM11_ARR", kRcc + 0x44, 18, 0x4001482C, 0xFFFF}};

}  // namespace

void Test() {
  // Reset values (sections 7.3.1 to 7.3.23).
  Check("RCC_CR", Reg(kCr) & 0xFFFF00FF, 0x83);
  Check("RCC_PLLCFGR", Reg(kPllcfgr), 0x24003010);
  Check("RCC_CFGR", Reg(kCfgr), 0);
  Check("RCC_AHB1ENR", Reg(kRcc + 0x30), 0x00100000);
  Check("RCC_APB1LPENR", Reg(kRcc + 0x60), 0x36FEC9FF);
  Check("RCC_APB2LPENR", Reg(kRcc + 0x64), 0x00075F33);
  Check("RCC_CSR", Reg(kCsr), 0x0E000000);
  Check("RCC_PLLI2SCFGR", Reg(kRcc + 0x84), 0x20003000);

  // Registers without clock read 0 and keep nothing (section 7.3.10).
  for (const Block& block : kBlocks) {
    Reg(block.address) = 0x55;
    Check(block.without, Reg(block.address), 0);
    Set(block.enable, Bit(block.bit));
    Check(block.with, Reg(block.address), block.value);
    Clear(block.enable, Bit(block.bit));
    Check(block.without, Reg(block.address), 0);
  }

  Reg(kRcc + 0x40) = Bit(17) | Bit(28);
  Check("RCC_APB1ENR reads back", Reg(kRcc + 0x40), Bit(17) | Bit(28));

  // Ready flags follow (section 7.3.1); of the low-speed oscillators, too (7.3.20, 7.3.21).
  Set(kCr, Bit(16));
  Check("HSERDY", Reg(kCr) >> 17 & 1, 1);
  Check("PLLRDY before", Reg(kCr) >> 25 & 1, 0);
  Set(kCsr, 1);
  Check("LSIRDY", Reg(kCsr) >> 1 & 1, 1);
  Set(kRcc + 0x70, 1);
  Check("LSERDY", Reg(kRcc + 0x70) >> 1 & 1, 1);

  // The flags of the reset are removed by RMVF (section 7.3.21).
  Set(kCsr, Bit(24));
  Check("RMVF", Reg(kCsr) >> 24, 0);

  // A switch to what does not run is not done (section 7.3.3).
  Set(kCfgr, 2);
  Check("SWS without PLL", Reg(kCfgr) >> 2 & 3, 0);
  Clear(kCfgr, 3);

  // From 8 MHz: / 8 * 336 / 2 = 168 MHz. PLLCFGR is fixed while the PLL is on (section 7.3.2).
  constexpr std::uint32_t kPll = 7u << 24 | Bit(22) | 336u << 6 | 8u;
  Reg(kPllcfgr) = kPll;
  Set(kCr, Bit(24));
  Check("PLLRDY", Reg(kCr) >> 25 & 1, 1);
  Reg(kPllcfgr) = 0;
  Check("PLLCFGR is fixed", Reg(kPllcfgr), kPll);
  Reg(kCfgr) = 5u << 10 | 4u << 13 | 2u;
  Check("SWS", Reg(kCfgr) >> 2 & 3, 2);
  // Clocks that feed the core cannot be switched off (section 7.3.1).
  Clear(kCr, Bit(24) | Bit(16));
  Check("PLLON stays", Reg(kCr) >> 24 & 3, 3);
  Check("HSEON stays", Reg(kCr) >> 16 & 3, 3);

  // SysTick at the core's rate, and at an eighth of it (PM0214, section 4.5.1); TIM2 at twice APB1, half the core's rate;
  // TIM1 at twice APB2, the core's rate.
  Reg(0xE000E014) = 0xFFFFFF;
  Reg(0xE000E018) = 0;
  Reg(0xE000E010) = 5;
  Wait(1);
  const auto systick = [] { return 0xFFFFFF - Reg(0xE000E018); };
  CheckNear("SysTick of the core", CountIn(systick), 10'000, 100);
  Reg(0xE000E010) = 1;
  CheckNear("SysTick of an eighth", CountIn(systick), 1'250, 20);
  EnableClocks();
  Reg(0x40000000) = 1;
  CheckNear("TIM2 of APB1", CountIn([] { return Reg(0x40000024); }), 5'000, 100);
  Reg(0x40010000) = 1;
  CheckNear("TIM1 of APB2", CountIn([] { return Reg(0x40010024); }), 10'000, 100);

  // SysTick that runs follows the clock, and keeps its source.
  Reg(0xE000E010) = 5;
  Reg(kCfgr) = 0;
  CheckNear("SysTick of HSI", CountIn(systick), 10'000, 100);
  Reg(kCfgr) = 5u << 10 | 4u << 13 | 2u;
  CheckNear("SysTick of the PLL", CountIn(systick), 10'000, 100);

  // APB1 undivided: TIM2 at its rate (section 7.2).
  Reg(kCfgr) = 2;
  CheckNear("TIM2 of undivided APB1", CountIn([] { return Reg(0x40000024); }), 10'000, 100);

  // APB1RSTR (section 7.3.8) resets the timer.
  Reg(kRcc + 0x20) = 1;
  Reg(kRcc + 0x20) = 0;
  Check("TIM2RST", Reg(0x40000000), 0);

  Reg(kCfgr) = 0;
  Check("SWS back", Reg(kCfgr) >> 2 & 3, 0);
  Clear(kCr, Bit(24));
  Check("PLLRDY goes", Reg(kCr) >> 24 & 3, 0);
}
