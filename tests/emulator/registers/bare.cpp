#include "tests/emulator/registers/bare.h"

extern "C" {
extern std::uint32_t _estack, _sdata, _edata, _sbss, _ebss;  // firmware/examples/minimal_c/stm32f4.ld
extern const std::uint32_t _sidata;
void Reset_Handler();
}

namespace {

constexpr std::uint32_t kConsole = 0x40011000;  // USART1

// Printed at the end: sending takes time, which what is tested here must not see.
char report[16 * 1024];
unsigned report_size = 0;

void Print(char character) {
  if (report_size < sizeof(report)) report[report_size++] = character;
}
void Flush() {
  Set(0x40023844, Bit(4));   // its clock: what is tested here begins as after a reset
  Reg(kConsole + 0x8) = 16;  // 1 Mbaud of 16 MHz
  Reg(kConsole + 0xC) = Bit(13) | Bit(3);
  for (unsigned i = 0; i < report_size; ++i) {
    while ((Reg(kConsole) & Bit(7)) == 0) {
    }
    Reg(kConsole + 4) = static_cast<std::uint8_t>(report[i]);
  }
  report_size = 0;
}
void Print(const char* text) {
  while (*text != 0) Print(*text++);
}
void PrintHex(std::uint32_t number) {
  Print("0x");
  for (int shift = 28; shift >= 0; shift -= 4) Print("0123456789abcdef"[number >> shift & 0xF]);
}
void Report(const char* name, bool right, std::uint32_t got, std::uint32_t expected) {
  Print(right ? "ok " : "wrong ");
  Print(name);
  if (!right) {
    Print(": got ");
    PrintHex(got);
    Print(" expected ");
    PrintHex(expected);
  }
  Print('\n');
}

void Dispatch() {
  std::uint32_t exception;
  asm volatile("mrs %0, ipsr" : "=r"(exception));
  const std::uint32_t interrupt = exception - 16;
  if (interrupt < 82 && handlers[interrupt] != nullptr) return handlers[interrupt]();
  Report("exception", false, exception, 0);
  if (interrupt < 82) Reg(0xE000E180 + interrupt / 32 * 4) = Bit(interrupt % 32);
  if (exception >= 16) return;
  Flush();
  for (;;) {
  }
}

struct Vectors {
  const void* stack;
  Handler handlers[15 + 82];
};
constexpr Vectors MakeVectors() {
  Vectors vectors{&_estack, {}};
  for (Handler& handler : vectors.handlers) handler = Dispatch;
  vectors.handlers[0] = Reset_Handler;
  return vectors;
}
[[gnu::section(".vectors"), gnu::used]] constinit const Vectors vectors = MakeVectors();

}  // namespace

Handler handlers[82];

void Check(const char* name, std::uint32_t got, std::uint32_t expected) {
  Report(name, got == expected, got, expected);
}
void CheckNear(const char* name, std::uint32_t got, std::uint32_t expected, std::uint32_t distance_max) {
  Report(name, got - expected + distance_max <= 2 * distance_max, got, expected);
}

void Handle(unsigned interrupt, Handler handler) {
  handlers[interrupt] = handler;
  Reg(0xE000E100 + interrupt / 32 * 4) = Bit(interrupt % 32);
}

void EnableClocks() {
  Reg(0x40023830) = ~0u;
  Reg(0x40023840) = ~0u;
  Reg(0x40023844) = ~0u;
}

std::uint32_t Cycles() { return Reg(0xE0001004); }

extern "C" void Reset_Handler() {
  const std::uint32_t* from = &_sidata;
  for (std::uint32_t* to = &_sdata; to != &_edata;) *to++ = *from++;
  for (std::uint32_t* to = &_sbss; to != &_ebss;) *to++ = 0;
  Set(0xE000EDFC, Bit(24));
  Set(0xE0001000, 1);
  Test();
  Print("done\n");
  Flush();
  for (;;) asm volatile("wfi");
}
