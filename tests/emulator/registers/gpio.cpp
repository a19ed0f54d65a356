// GPIO (section 8.4).
#include "tests/emulator/registers/bare.h"

void Test() {
  EnableClocks();
  constexpr std::uint32_t kA = 0x40020000, kB = 0x40020400, kD = 0x40020C00, kI = 0x40022000;
  constexpr std::uint32_t kSpeed = 0x08, kPull = 0x0C, kIdr = 0x10, kOdr = 0x14, kBsrr = 0x18, kAfrh = 0x24;
  Check("GPIOA_MODER", Reg(kA), 0xA8000000);
  Check("GPIOA_PUPDR", Reg(kA + kPull), 0x64000000);
  Check("GPIOB_MODER", Reg(kB), 0x00000280);
  Check("GPIOB_OSPEEDR", Reg(kB + kSpeed), 0x000000C0);
  Check("GPIOB_PUPDR", Reg(kB + kPull), 0x00000100);
  Check("GPIOD_MODER", Reg(kD), 0);
  Check("GPIOI_MODER", Reg(kI), 0);

  Reg(kD + kAfrh) = 0x77;
  Check("AFRH reads back", Reg(kD + kAfrh), 0x77);
  Reg(kD) = 1u << 24 | 1u << 26;  // pins 12 and 13: outputs
  Reg(kD + kBsrr) = Bit(12);
  Check("BSRR sets", Reg(kD + kOdr), Bit(12));
  Check("IDR follows", Reg(kD + kIdr), Bit(12));
  Reg(kD + kBsrr) = Bit(13) | Bit(12 + 16);
  Check("BSRR resets", Reg(kD + kOdr), Bit(13));
  Reg(kD + kBsrr) = Bit(12) | Bit(12 + 16);
  Check("setting wins", Reg(kD + kOdr), Bit(12) | Bit(13));
  Check("BSRR reads 0", Reg(kD + kBsrr), 0);
  // Half a register, as older drivers write it: BSRRH resets.
  *reinterpret_cast<volatile std::uint16_t*>(kD + kBsrr + 2) = Bit(12);
  Check("half of BSRR", Reg(kD + kIdr), Bit(13));
  Reg(kD + kPull) = 1;
  Check("pulled up", Reg(kD + kIdr), Bit(13) | 1);
  // Through the bit-band alias (PM0214, section 2.2.5): GPIOD_ODR, bit 12.
  Reg(0x42000000 + (kD + kOdr - 0x40000000) * 32 + 12 * 4) = 1;
  Check("bit-band", Reg(kD + kOdr), Bit(12) | Bit(13));
  // AHB1RSTR (section 7.3.5).
  Reg(0x40023810) = Bit(3);
  Reg(0x40023810) = 0;
  Check("GPIODRST", Reg(kD), 0);
}
