#include "harness/emulator/diagnosis/cpu_state.h"

#include <gtest/gtest.h>

namespace tiltproof::harness {
namespace {

TEST(CpuState, IsReadFromQemusDump) {
  const auto state = ParseCpuState(
      "qemu: fatal: Lockup\n"
      "R00=00000001 R01=00000002 R02=00000003 R03=00000004\n"
      "R04=00000005 R05=00000006 R06=00000007 R07=00000008\n"
      "R08=00000009 R09=0000000a R10=0000000b R11=0000000c\n"
      "R12=0000000d R13=2001fff0 R14=fffffff9 R15=08000412\n"
      "XPSR=61000003 -ZC- T handler\n");
  ASSERT_TRUE(state);
  EXPECT_EQ(state->r[0], 1U);
  EXPECT_EQ(state->r[12], 13U);
  EXPECT_EQ(state->stack_pointer(), 0x2001'fff0U);
  EXPECT_EQ(state->link(), 0xFFFF'FFF9U);
  EXPECT_EQ(state->pc(), 0x0800'0412U);
  EXPECT_EQ(HandlerName(state->exception()), "the hard fault's handler");
  EXPECT_FALSE(ParseCpuState("R00=00000001 R01=00000002"));
}

// Encodings as arm-none-eabi-as gives them.
TEST(CpuState, LoadsTellTheirAddress) {
  CpuState state;
  state.r[1] = 0x10;
  state.r[3] = 0x4002'3800;
  EXPECT_EQ(LoadAddress(state, 0x681A), 0x4002'3800U);       // ldr r2, [r3]
  EXPECT_EQ(LoadAddress(state, 0x685A), 0x4002'3804U);       // ldr r2, [r3, #4]
  EXPECT_EQ(LoadAddress(state, 0x785A), 0x4002'3801U);       // ldrb r2, [r3, #1]
  EXPECT_EQ(LoadAddress(state, 0x885A), 0x4002'3802U);       // ldrh r2, [r3, #2]
  EXPECT_EQ(LoadAddress(state, 0x585A), 0x4002'3810U);       // ldr r2, [r3, r1]
  EXPECT_EQ(LoadAddress(state, 0x2074'F8D3), 0x4002'3874U);  // ldr.w r2, [r3, #0x74]
  EXPECT_EQ(LoadAddress(state, 0x2B04'F853), 0x4002'3800U);  // ldr.w r2, [r3], #4
  EXPECT_EQ(LoadAddress(state, 0x2C04'F853), 0x4002'37FCU);  // ldr.w r2, [r3, #-4]
  EXPECT_EQ(LoadAddress(state, 0x2021'F853), 0x4002'3840U);  // ldr.w r2, [r3, r1, lsl #2]
  EXPECT_EQ(LoadAddress(state, 0x2005'F893), 0x4002'3805U);  // ldrb.w r2, [r3, #5]
  EXPECT_FALSE(LoadAddress(state, 0x601A));                  // str r2, [r3]
  EXPECT_FALSE(LoadAddress(state, 0x505A));                  // str r2, [r3, r1]
  EXPECT_FALSE(LoadAddress(state, 0x9A01));                  // ldr r2, [sp, #4]
  EXPECT_FALSE(LoadAddress(state, 0x4A01));                  // ldr r2, [pc, #4]
  EXPECT_FALSE(LoadAddress(state, 0x2074'F8C3));             // str.w r2, [r3, #0x74]
  EXPECT_FALSE(LoadAddress(state, 0xBF30));                  // wfi
}

}  // namespace
}  // namespace tiltproof::harness
