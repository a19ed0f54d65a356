// PWR (section 5.4) and the flash interface (section 3.9).
#include "tests/emulator/registers/bare.h"

void Test() {
  EnableClocks();
  constexpr std::uint32_t kCr = 0x40007000, kCsr = 0x40007004;
  Check("PWR_CR", Reg(kCr), 0x4000);
  Check("PWR_CSR VOSRDY", Reg(kCsr), 0x4000);
  Set(kCr, Bit(8));
  Check("DBP", Reg(kCr), 0x4100);
  Set(kCsr, Bit(9));
  Check("BRR follows BRE", Reg(kCsr), 0x4208);

  constexpr std::uint32_t kAcr = 0x40023C00, kKeyr = kAcr + 4, kOptkeyr = kAcr + 8, kSr = kAcr + 0xC,
                          kFlashCr = kAcr + 0x10, kOptcr = kAcr + 0x14;
  Check("FLASH_ACR", Reg(kAcr), 0);
  Check("FLASH_SR", Reg(kSr), 0);
  Check("FLASH_CR", Reg(kFlashCr), 0x80000000);
  Check("FLASH_OPTCR", Reg(kOptcr), 0x0FFFAAED);
  Reg(kAcr) = 0x705;
  Check("FLASH_ACR reads back", Reg(kAcr), 0x705);

  // Unlocking (section 3.6.1).
  Reg(kFlashCr) = 1;
  Check("FLASH_CR locked", Reg(kFlashCr), 0x80000000);
  Reg(kKeyr) = 0x45670123;
  Reg(kKeyr) = 0xCDEF89AB;
  Check("FLASH_CR unlocked", Reg(kFlashCr), 0);
  Reg(kFlashCr) = 0x80000000;
  Check("FLASH_CR locked again", Reg(kFlashCr), 0x80000000);
  Reg(kKeyr) = 0xCDEF89AB;  // a wrong first key: not before the next reset
  Reg(kKeyr) = 0x45670123;
  Reg(kKeyr) = 0xCDEF89AB;
  Check("FLASH_CR shut", Reg(kFlashCr), 0x80000000);
  Reg(kOptkeyr) = 0x08192A3B;
  Reg(kOptkeyr) = 0x4C5D6E7F;
  Check("FLASH_OPTCR unlocked", Reg(kOptcr) & 1, 0);
}
