// The base of a test of the chip's registers: only a start-up and a console.
//
//   void Test() { Check("RCC_CR", Reg(0x40023800), 0x83); }
//
// prints "ok RCC_CR", or "wrong RCC_CR: got 0x00000000 expected 0x00000083"; after Test() "done". The core runs from the
// internal oscillator at 16 MHz, as after every reset. Sections are those of RM0090, unless another manual is named.
#pragma once

#include <cstdint>

// Each image's own.
void Test();

inline volatile std::uint32_t& Reg(std::uint32_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}
inline void Set(std::uint32_t address, std::uint32_t bits) { Reg(address) = Reg(address) | bits; }
inline void Clear(std::uint32_t address, std::uint32_t bits) { Reg(address) = Reg(address) & ~bits; }
inline void Touch(std::uint32_t address) {  // reads it, for what that does
  [[maybe_unused]] const std::uint32_t value = Reg(address);
}
constexpr std::uint32_t Bit(unsigned number) { return 1u << number; }

void Check(const char* name, std::uint32_t got, std::uint32_t expected);
// Not further away from it than that.
void CheckNear(const char* name, std::uint32_t got, std::uint32_t expected, std::uint32_t distance_max);

// Called in the interrupt; from the start on each one is a failure, and is switched off.
using Handler = void (*)();
extern Handler handlers[82];
// Enables an interrupt (PM0214, section 4.3.2), which calls this.
void Handle(unsigned interrupt, Handler handler);

// Enables the clock of every block (section 7.3): without it, the block's registers read 0.
void EnableClocks();

// The core's cycles (ARMv7-M ARM, section C1.8): 16 MHz here, 62.5 ns each.
std::uint32_t Cycles();
inline constexpr std::uint32_t kCyclesPerUs = 16;
// Until then, or until that many microseconds have passed: whether it has come.
template <class Condition>
bool Await(std::uint32_t us, const Condition& come) {
  const std::uint32_t begin = Cycles();
  while (!come())
    if (Cycles() - begin > us * kCyclesPerUs) return false;
  return true;
}
inline void Wait(std::uint32_t us) {
  Await(us, [] { return false; });
}
