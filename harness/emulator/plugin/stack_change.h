// Change of the stack pointer by a Thumb instruction, from its code alone (ARMv7-M ARM, section A7.7).
//
//   StackChange(0xB510, 0);        // push {r4, lr}: -8
//   StackChange(0xF5AD, 0x6D80);   // sub.w sp, sp, #1024: -1024
//   StackChange(0x46BD, 0);        // mov sp, r7: nullopt, the code does not say
#pragma once

#include <bit>
#include <cstdint>
#include <optional>

namespace tiltproof::qemu {

// The constant of an instruction with the fields i:imm3:imm8 (section A5.3.2).
constexpr std::uint32_t ExpandImmediate(std::uint32_t imm12) {
  const std::uint32_t byte = imm12 & 0xFF;
  switch (imm12 >> 8) {
    case 0:
      return byte;
    case 1:
      return byte << 16 | byte;
    case 2:
      return byte << 24 | byte << 8;
    case 3:
      return byte << 24 | byte << 16 | byte << 8 | byte;
    default:
      return std::rotr(0x80U | (imm12 & 0x7FU), static_cast<int>(imm12 >> 7));
  }
}

// `first`, `second`: halfwords of the instruction; `second` is 0 for one of 16 bits. Bytes, negative when the stack grows;
// 0 for an instruction that leaves the stack pointer alone; nullopt when a register decides.
constexpr std::optional<std::int32_t> StackChange(std::uint16_t first, std::uint16_t second) {
  const auto is = [](std::uint32_t half, std::uint32_t mask, std::uint32_t value) {
    return (half & mask) == value;
  };
  const auto words = [](std::uint32_t registers) { return 4 * std::popcount(registers); };
  const std::int32_t imm8 = second & 0xFF;
  const std::uint32_t imm12 = (first & 0x400U) << 1 | (second & 0x7000U) >> 4 | (second & 0xFFU);
  // 16 bits.
  if (is(first, 0xFE00, 0xB400)) return -words(first & 0x1FFU);                     // push
  if (is(first, 0xFE00, 0xBC00)) return words(first & 0x1FFU);                      // pop
  if (is(first, 0xFF80, 0xB080)) return -4 * (first & 0x7F);                        // sub sp, #
  if (is(first, 0xFF80, 0xB000)) return 4 * (first & 0x7F);                         // add sp, #
  if (is(first, 0xFF87, 0x4685) || is(first, 0xFF87, 0x4485)) return std::nullopt;  // mov sp, r; add sp, r
  // 32 bits.
  if (first == 0xE92D) return -words(second);                                     // stmdb sp!
  if (first == 0xE8BD) return words(second);                                      // ldmia sp!
  if (is(first, 0xFFBF, 0xED2D) && is(second, 0x0E00, 0x0A00)) return -4 * imm8;  // vpush
  if (is(first, 0xFFBF, 0xECBD) && is(second, 0x0E00, 0x0A00)) return 4 * imm8;   // vpop
  if (first == 0xF84D && is(second, 0x0F00, 0x0D00)) return -imm8;                // str [sp, #-]!
  if (first == 0xF85D && is(second, 0x0F00, 0x0B00)) return imm8;                 // ldr [sp], #
  if (first == 0xE96D) return -4 * imm8;                                          // strd [sp, #-]!
  if (first == 0xE8FD) return 4 * imm8;                                           // ldrd [sp], #
  if (!is(second, 0x8F00, 0x0D00)) return 0;
  const auto expanded = static_cast<std::int32_t>(ExpandImmediate(imm12));
  if (is(first, 0xFBEF, 0xF1AD)) return -expanded;                                  // sub.w sp, sp, #
  if (is(first, 0xFBEF, 0xF10D)) return expanded;                                   // add.w sp, sp, #
  if (is(first, 0xFBFF, 0xF2AD)) return -static_cast<std::int32_t>(imm12);          // subw
  if (is(first, 0xFBFF, 0xF20D)) return static_cast<std::int32_t>(imm12);           // addw
  if (is(first, 0xFFEF, 0xEBAD) || is(first, 0xFFEF, 0xEB0D)) return std::nullopt;  // sub.w sp, sp, r
  return 0;
}

// Bytes that an instruction stores right below the address in a register other than the stack pointer, which then holds
// the new end: stmdb, vstmdb.
struct SavedRegisters {
  std::uint32_t base;  // the register's number
  std::uint32_t bytes;
  bool is_float;
};
constexpr std::optional<SavedRegisters> SavedBelow(std::uint16_t first, std::uint16_t second) {
  const std::uint32_t base = first & 15U;
  if (base >= 13) return std::nullopt;
  if ((first & 0xFFF0U) == 0xE920)
    return SavedRegisters{base, 4U * static_cast<unsigned>(std::popcount(second)), false};
  if ((first & 0xFFB0U) == 0xED20 && (second & 0x0E00U) == 0x0A00)
    return SavedRegisters{base, 4U * (second & 0xFFU), true};
  return std::nullopt;
}

}  // namespace tiltproof::qemu
