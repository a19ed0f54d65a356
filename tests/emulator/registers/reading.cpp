// Cost of reading registers: only the instructions, 8 ns each, whether the emulator knows the reader or not.
#include "tests/emulator/registers/bare.h"

namespace {

constexpr std::uint32_t kRounds = 1000, kInstructions = 14;
constexpr std::uint32_t kCycles = kRounds * kInstructions * 8 * kCyclesPerUs / 1000;

// In cycles: a loop that reads a register at its begin and in its middle.
[[gnu::noinline]] std::uint32_t Read(std::uint32_t address) {
  std::uint32_t rounds = kRounds, value;
  const std::uint32_t begin = Cycles();
  asm volatile(
      "1: ldr %1, [%2]\n\t"
      "nop; nop; nop; nop; nop\n\t"
      "ldr %1, [%2]\n\t"
      "nop; nop; nop; nop; nop\n\t"
      "subs %0, #1\n\t"
      "bne 1b"
      : "+l"(rounds), "=&l"(value)
      : "l"(address)
      : "cc");
  return Cycles() - begin;
}

void ReadTwice(const char* name, std::uint32_t address) {
  CheckNear(name, Read(address), kCycles, 2);
  Wait(2000);  // longer than a turn of the harness, after which the readers are known
  CheckNear(name, Read(address), kCycles, 2);
}

}  // namespace

void Test() {
  EnableClocks();
  Reg(0xE000E014) = 0xFFFFFF;
  Reg(0xE000E010) = 5;
  ReadTwice("SYST_CVR", 0xE000E018);  // PM0214, section 4.5
  ReadTwice("ICSR", 0xE000ED04);
  ReadTwice("USART_SR", 0x40004400);
  ReadTwice("TIM2_CNT", 0x40000024);
  ReadTwice("memory", 0x20000000);
  // SysTick has counted on: by the same clock as the cycle counter.
  const std::uint32_t begin = Reg(0xE000E018), cycles = Cycles();
  Read(0xE000E018);
  const std::uint32_t counted = (begin - Reg(0xE000E018)) & 0xFFFFFF;
  CheckNear("SysTick beside CYCCNT", counted, Cycles() - cycles, 4);
}
