// Use of a stack by its content; and the change of the stack pointer by instructions, against the codes that the assembler
// makes of them (arm-none-eabi-as, GNU Binutils).
#include "harness/emulator/plugin/stack_change.h"
#include "harness/emulator/stack_content.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

namespace tiltproof {
namespace {

using harness::UsedBytes;
using qemu::StackChange;

struct Case {
  const char* text;
  std::uint16_t first, second;
  std::optional<std::int32_t> change;
};

TEST(StackChange, IsWhatTheInstructionSays) {
  for (const Case& instruction : {
           Case{"push {r4, lr}", 0xB510, 0, -8},
           Case{"push {r0-r7, lr}", 0xB5FF, 0, -36},
           Case{"push {r4-r11, lr}", 0xE92D, 0x4FF0, -36},
           Case{"push {r8}", 0xF84D, 0x8D04, -4},
           Case{"pop {r4, pc}", 0xBD10, 0, 8},
           Case{"pop {r4-r11, pc}", 0xE8BD, 0x8FF0, 36},
           Case{"sub sp, #8", 0xB082, 0, -8},
           Case{"sub sp, #508", 0xB0FF, 0, -508},
           Case{"add sp, #508", 0xB07F, 0, 508},
           Case{"sub.w sp, sp, #1024", 0xF5AD, 0x6D80, -1024},
           Case{"sub.w sp, sp, #0x1000", 0xF5AD, 0x5D80, -4096},
           Case{"sub.w sp, sp, #0x00ff00ff", 0xF1AD, 0x1DFF, -16'711'935},
           Case{"subs.w sp, sp, #2048", 0xF5BD, 0x6D00, -2048},
           Case{"add.w sp, sp, #1024", 0xF50D, 0x6D80, 1024},
           Case{"subw sp, sp, #1020", 0xF2AD, 0x3DFC, -1020},
           Case{"subw sp, sp, #4092", 0xF6AD, 0x7DFC, -4092},
           Case{"addw sp, sp, #4092", 0xF60D, 0x7DFC, 4092},
           Case{"vpush {d8-d15}", 0xED2D, 0x8B10, -64},
           Case{"vpush {s16}", 0xED2D, 0x8A01, -4},
           Case{"vpush {s17-s19}", 0xED6D, 0x8A03, -12},
           Case{"vpop {d8-d15}", 0xECBD, 0x8B10, 64},
           Case{"str r0, [sp, #-252]!", 0xF84D, 0x0DFC, -252},
           Case{"ldr r0, [sp], #4", 0xF85D, 0x0B04, 4},
           Case{"strd r0, r1, [sp, #-8]!", 0xE96D, 0x0102, -8},
           Case{"ldrd r0, r1, [sp], #8", 0xE8FD, 0x0102, 8},
           Case{"mov sp, r7", 0x46BD, 0, std::nullopt},
           Case{"mov sp, r3", 0x469D, 0, std::nullopt},
           Case{"add sp, r3", 0x449D, 0, std::nullopt},
           Case{"sub.w sp, sp, r3", 0xEBAD, 0x0D03, std::nullopt},
           Case{"add.w sp, sp, r3", 0xEB0D, 0x0D03, std::nullopt},
           Case{"mov r7, sp", 0x466F, 0, 0},
           Case{"add r7, sp, #16", 0xAF04, 0, 0},
           Case{"str r0, [sp, #16]", 0x9004, 0, 0},
           Case{"ldr r0, [sp, #16]", 0x9804, 0, 0},
           Case{"ldr.w r0, [sp, #-4]", 0xF85D, 0x0C04, 0},
           Case{"str.w r0, [sp, #16]", 0xF8CD, 0x0010, 0},
           Case{"sub.w r0, sp, #1024", 0xF5AD, 0x6080, 0},
           Case{"sub.w r3, r3, #1024", 0xF5A3, 0x6380, 0},
           Case{"subs r0, #8", 0x3808, 0, 0},
           Case{"stmdb r0!, {r4-r11}", 0xE920, 0x0FF0, 0},
           Case{"stmia.w sp, {r0-r3}", 0xE88D, 0x000F, 0},
           Case{"vstmdb r0!, {s16-s31}", 0xED20, 0x8A10, 0},
           Case{"vstr s0, [sp, #4]", 0xED8D, 0x0A01, 0},
           Case{"bl", 0xF7FF, 0xFFFE, 0},
           Case{"add r0, sp", 0x4468, 0, 0},
       })
    EXPECT_EQ(StackChange(instruction.first, instruction.second), instruction.change) << instruction.text;
}

TEST(SavedBelow, ByRegistersOtherThanTheStackPointer) {
  const auto is = [](std::uint16_t first, std::uint16_t second, std::uint32_t base, std::uint32_t bytes,
                     bool is_float) {
    const auto saved = qemu::SavedBelow(first, second);
    return saved && saved->base == base && saved->bytes == bytes && saved->is_float == is_float;
  };
  EXPECT_TRUE(is(0xE920, 0x0FF0, 0, 32, false));   // stmdb r0!, {r4-r11}
  EXPECT_TRUE(is(0xE92C, 0x4FF0, 12, 36, false));  // stmdb r12!, {r4-r11, lr}
  EXPECT_TRUE(is(0xED20, 0x8A10, 0, 64, true));    // vstmdb r0!, {s16-s31}
  EXPECT_TRUE(is(0xED60, 0x8A03, 0, 12, true));    // vstmdb r0!, {s17-s19}
  EXPECT_FALSE(qemu::SavedBelow(0xE92D, 0x4FF0));  // push
  EXPECT_FALSE(qemu::SavedBelow(0xED2D, 0x8B10));  // vpush
  EXPECT_FALSE(qemu::SavedBelow(0xE8A0, 0x0FF0));  // stmia r0!, {r4-r11}
  EXPECT_FALSE(qemu::SavedBelow(0xE900, 0x0FF0));  // stmdb r0, {r4-r11}
  EXPECT_FALSE(qemu::SavedBelow(0xED80, 0x0A01));  // vstr s0, [r0, #4]
}

std::vector<std::uint8_t> Bytes(const std::vector<std::uint32_t>& words) {
  std::vector<std::uint8_t> bytes(4 * words.size());
  std::memcpy(bytes.data(), words.data(), bytes.size());
  return bytes;
}

TEST(UsedBytes, FromTheFirstWordThatIsNotTheFillingOfTheLowestOnes) {
  for (const std::uint32_t fill : {0U, 0xA5A5'A5A5U, 0xAAAA'AAAAU, 0xFFFF'FFFFU})
    for (std::uint32_t used_words = 0; used_words <= 8; ++used_words) {
      std::vector<std::uint32_t> words(8, fill);
      // Written words may hold the filling, too.
      for (std::uint32_t i = 8 - used_words; i < 8; ++i)
        words[i] = i == 7 && used_words > 1 ? fill : 0x2000'1234;
      EXPECT_EQ(UsedBytes(Bytes(words), 32), 4 * used_words) << fill;
    }
}

TEST(UsedBytes, FromTheStackPointerWhereNothingWasWritten) {
  const auto content = Bytes({0, 0, 0, 0, 0, 0x0800'0123, 0, 0});
  EXPECT_EQ(UsedBytes(content, 32), 12U);
  EXPECT_EQ(UsedBytes(content, 24), 12U);
  EXPECT_EQ(UsedBytes(content, 8), 24U);
  EXPECT_EQ(UsedBytes(content, 0), 32U);
  EXPECT_EQ(UsedBytes({}, 0), 0U);
}

// CMSIS-RTOS RTX, rtx_lib.h: osRtxStackMagicWord, osRtxStackFillPattern.
TEST(UsedBytes, TheMagicWordOfRtxIsNoUse) {
  EXPECT_EQ(UsedBytes(Bytes({0xE25A'2EA5, 0xCCCC'CCCC, 0xCCCC'CCCC, 1, 2}), 20), 8U);
  EXPECT_EQ(UsedBytes(Bytes({0xE25A'2EA5, 0x0800'0123, 0xCCCC'CCCC, 1, 2}), 20), 20U);
}

}  // namespace
}  // namespace tiltproof
