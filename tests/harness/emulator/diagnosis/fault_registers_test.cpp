#include "harness/emulator/diagnosis/fault_registers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "harness/emulator/stm32f405.h"

namespace tiltproof::harness {
namespace {

using testing::HasSubstr;
using testing::Not;

// By PM0214, figure 22 and tables 51 to 53.
TEST(FaultRegisters, AreToldInWords) {
  EXPECT_EQ(FaultText({.cfsr = 0x8200, .bfar = 0x6000'0000}),
            "bus fault: precise data access to 0x60000000 (no memory)");
  EXPECT_EQ(FaultText({.cfsr = 0x8200, .bfar = 0x4002'3800}),
            "bus fault: precise data access to 0x40023800 (RCC_CR)");
  EXPECT_THAT(FaultText({.cfsr = 0x0082, .mmfar = 0x2001'0010}),
              HasSubstr("MPU forbids to 0x20010010 (RAM)"));
  EXPECT_THAT(FaultText({.cfsr = 1U << 25}), HasSubstr("division by zero"));
  EXPECT_THAT(FaultText({.cfsr = 1U << 24}), HasSubstr("unaligned"));
  EXPECT_THAT(FaultText({.cfsr = 1U << 16}), HasSubstr("undefined instruction"));
  EXPECT_THAT(FaultText({.cfsr = 1U << 17}), HasSubstr("invalid state"));
  EXPECT_THAT(FaultText({.cfsr = 1U << 19}), HasSubstr("coprocessor"));
  EXPECT_THAT(FaultText({.cfsr = 1U << 12}), HasSubstr("stack overflow"));
  EXPECT_THAT(FaultText({.hfsr = 2}), HasSubstr("vector table"));
  EXPECT_EQ(FaultText({}), "");
  // FORCED says only that another fault is the cause.
  EXPECT_EQ(FaultText({.hfsr = 1U << 30}), "");
  // An address counts only while its valid bit is set.
  EXPECT_THAT(FaultText({.cfsr = 0x0200, .bfar = 0x6000'0000}), Not(HasSubstr("0x6")));
}

class Memory {
 public:
  explicit Memory(std::vector<std::uint32_t> words) : words_(std::move(words)) {}
  ReadWords reader() const {
    return [this](std::uint32_t address, std::uint32_t count) {
      std::vector<std::uint32_t> read;
      for (std::size_t i = (address - kTop) / 4; read.size() < count; ++i)
        read.push_back(i < words_.size() ? words_[i] : 0);
      return read;
    };
  }
  static constexpr std::uint32_t kTop = 0x2001'0000;

 private:
  std::vector<std::uint32_t> words_;
};

CpuState InHandler(int exception, std::uint32_t link) {
  CpuState state;
  state.r[13] = Memory::kTop;
  state.r[14] = link;
  state.xpsr = 0x0100'0000U + static_cast<std::uint32_t>(exception);
  return state;
}

TEST(ExceptionFrames, AreFoundBehindWhatTheHandlerHasPushed) {
  const Memory memory({0x2000'0004, 0xFFFF'FFF9, 1, 2, 3, 4, 12, 0x0800'0201, 0x0800'0410, 0x2100'0000});
  const auto frames = FindExceptionFrames(InHandler(3, 0x0800'0101), memory.reader());
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].address, Memory::kTop + 8);
  EXPECT_EQ(frames[0].pc, 0x0800'0410U);
  EXPECT_EQ(frames[0].link, 0x0800'0201U);
  EXPECT_EQ(frames[0].r0, 1U);
}

TEST(ExceptionFrames, LeadToTheFirstFault) {
  const Memory memory({1, 2, 3, 4, 12, 0xFFFF'FFF9, 0x0800'0300, 0x2100'0005, 1, 2, 3, 4, 12, 0x0800'0201,
                       0x0800'0410, 0x2100'0000});
  const auto frames = FindExceptionFrames(InHandler(3, 0xFFFF'FFF1), memory.reader());
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].exception(), 5);
  EXPECT_EQ(frames[1].exception(), 0);
  EXPECT_EQ(frames[1].pc, 0x0800'0410U);
}

TEST(ExceptionFrames, AJumpToAnEvenAddressLeavesThumbState) {
  const Memory memory({1, 2, 3, 4, 12, 0x0800'0201, 0, 0x6000'0000});
  ASSERT_EQ(FindExceptionFrames(InHandler(6, 0xFFFF'FFF9), memory.reader()).size(), 1U);
}

TEST(ExceptionFrames, AreNotInvented) {
  const Memory memory({1, 2, 3, 4, 12, 0x0800'0201, 0x0800'0410, 0x2100'0000});
  EXPECT_TRUE(FindExceptionFrames(InHandler(0, 0xFFFF'FFF9), memory.reader()).empty());
  // On the process stack.
  EXPECT_TRUE(FindExceptionFrames(InHandler(3, 0xFFFF'FFFD), memory.reader()).empty());
  CpuState overflown = InHandler(3, 0xFFFF'FFF9);
  overflown.r[13] = 0x1FFF'FFE0;
  EXPECT_TRUE(FindExceptionFrames(overflown, memory.reader()).empty());
}

// By RM0090, table 1 and the register maps.
TEST(RegisterNames, AreThoseOfTheReferenceManual) {
  EXPECT_EQ(RegisterName(0x4002'3800), "RCC_CR");
  EXPECT_EQ(RegisterName(0x4002'3874), "RCC_CSR");
  EXPECT_EQ(RegisterName(0x4000'7004), "PWR_CSR");
  EXPECT_EQ(RegisterName(0x4002'3C0C), "FLASH_SR");
  EXPECT_EQ(RegisterName(0x4000'4400), "USART2_SR");
  EXPECT_EQ(RegisterName(0x4001'140C), "USART6_CR1");
  EXPECT_EQ(RegisterName(0x4002'6010), "DMA1_S0CR");
  EXPECT_EQ(RegisterName(0x4002'6488), "DMA2_S5CR");
  EXPECT_EQ(RegisterName(0x4002'6404), "DMA2_HISR");
  EXPECT_EQ(RegisterName(0x4000'1010), "TIM6_SR");
  EXPECT_EQ(RegisterName(0x4002'0C10), "GPIOD_IDR");
  EXPECT_EQ(RegisterName(0x4000'2800), "RTC + 0x0");
  EXPECT_EQ(RegisterName(0xE000'E010), "SYSTICK_CTRL");
  EXPECT_EQ(RegisterName(0xE000'1004), "DWT_CYCCNT");
  EXPECT_EQ(RegisterName(0x6000'0000), "");
  EXPECT_EQ(EmulationOf(0x4002'3874), Emulated::kYes);
  EXPECT_EQ(EmulationOf(0x4000'7C00), Emulated::kNo);
}

}  // namespace
}  // namespace tiltproof::harness
