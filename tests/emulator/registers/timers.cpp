// Timers as time bases (sections 17.4, 18.4, 19.4 and 20.4). The core and APB1 are at 16 MHz: timers count 16 a microsecond.
#include "tests/emulator/registers/bare.h"

namespace {

constexpr std::uint32_t kDier = 0x0C, kSr = 0x10, kEgr = 0x14, kCnt = 0x24, kPsc = 0x28, kArr = 0x2C;
constexpr std::uint32_t kTim6 = 0x40001000;
volatile unsigned count = 0;
std::uint32_t last = 0, period = 0;

void OnTim6() {
  Reg(kTim6 + kSr) = 0;
  count = count + 1;
  period = Cycles() - last;
  last = Cycles();
}

struct Place {
  const char* name;
  std::uint32_t address, reload;
  unsigned interrupt;
};
constexpr Place kPlaces[] = {{"TIM1", 0x40010000, 0xFFFF, 25},     {"TIM2", 0x40000000, 0xFFFFFFFF, 28},
                             {"TIM3", 0x40000400, 0xFFFF, 29},     {"TIM4", 0x40000800, 0xFFFF, 30},
                             {"TIM5", 0x40000C00, 0xFFFFFFFF, 50}, {"TIM6", 0x40001000, 0xFFFF, 54},
                             {"TIM7", 0x40001400, 0xFFFF, 55},     {"TIM8", 0x40010400, 0xFFFF, 44},
                             {"TIM9", 0x40014000, 0xFFFF, 24},     {"TIM10", 0x40014400, 0xFFFF, 25},
                             {"TIM11", 0x40014800, 0xFFFF, 26},    {"TIM12", 0x40001800, 0xFFFF, 43},
                             {"TIM13", 0x40001C00, 0xFFFF, 44},    {"TIM14", 0x40002000, 0xFFFF, 45}};
std::uint32_t under_test = 0;
void OnAny() {
  count = count + 1;
  Reg(under_test + kSr) = 0;
}

}  // namespace

void Test() {
  EnableClocks();
  for (const Place& place : kPlaces) {
    Check(place.name, Reg(place.address + kArr), place.reload);
    // One update interrupt of each (table 62), after 100 us.
    under_test = place.address;
    count = 0;
    Handle(place.interrupt, OnAny);
    Reg(place.address + kArr) = 1'600 - 1;
    Reg(place.address + kDier) = 1;
    Reg(place.address) = 1 | Bit(3);
    Check(place.name, Await(110, [] { return count != 0; }), 1);
    Check(place.name, Reg(place.address) & 1, 0);  // one-pulse mode: it has stopped (section 18.3.10)
    Reg(place.address + kDier) = 0;
  }

  // A tick of 1 ms: prescaler 16, 1000 counts. UG loads the prescaler, and sets UIF (section 20.4.5).
  Reg(kTim6 + kPsc) = 16 - 1;
  Reg(kTim6 + kArr) = 1'000 - 1;
  Reg(kTim6 + kEgr) = 1;
  Check("UIF by UG", Reg(kTim6 + kSr), 1);
  Reg(kTim6 + kSr) = 0;
  Check("UIF cleared", Reg(kTim6 + kSr), 0);
  Reg(kTim6) = Bit(2);  // URS: UG sets no flag
  Reg(kTim6 + kEgr) = 1;
  Check("URS", Reg(kTim6 + kSr), 0);
  Handle(54, OnTim6);
  count = 0;
  Reg(kTim6 + kDier) = 1;
  Reg(kTim6) = 1;
  Wait(500);
  CheckNear("CNT in the middle", Reg(kTim6 + kCnt), 500, 5);
  Wait(10'000);
  Check("ten ticks", count, 10);
  CheckNear("period", period, 16'000, 40);

  // A new prescaler waits for the update; a new reload value does so only with ARPE (sections 20.3.2 and 20.4.1).
  Await(1'100, [] { return Reg(kTim6 + kCnt) == 10; });
  Reg(kTim6 + kPsc) = 8 - 1;
  Wait(100);
  CheckNear("PSC is buffered", Reg(kTim6 + kCnt), 110, 5);
  const unsigned before = count;
  Await(1'100, [before] { return count != before; });
  Wait(100);
  CheckNear("PSC is loaded", Reg(kTim6 + kCnt), 200, 10);
  Reg(kTim6) = 1 | Bit(7);
  Reg(kTim6 + kArr) = 500 - 1;
  unsigned n = count;
  Await(1'100, [n] { return count != n; });
  n = count;
  Wait(1'100);
  Check("ARR is loaded", count - n, 4);  // 250 us each

  // Stopped, it keeps its count.
  Reg(kTim6) = 0;
  const std::uint32_t held = Reg(kTim6 + kCnt);
  Wait(50);
  Check("CNT held", Reg(kTim6 + kCnt), held);
  Reg(kTim6 + kCnt) = 7;
  Check("CNT written", Reg(kTim6 + kCnt), 7);
}
