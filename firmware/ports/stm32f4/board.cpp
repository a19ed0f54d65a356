#include "firmware/ports/stm32f4/board.h"

#include "firmware/ports/stm32f4/pins.h"
#include "firmware/ports/stm32f4/stm32f4.h"

namespace tiltproof::stm32f4 {
namespace {

bool crystal_runs = true;
std::int64_t tick_count = 0;

constexpr std::uint32_t kCyclesPerTick = kCoreHz / kTickHz;

// Some 50 ms on the internal oscillator at 16 MHz; a crystal starts within a few.
constexpr std::uint32_t kCrystalTries = 100'000;

// RM0090, section 7.2: main PLL from 8 MHz (crystal) or 16 MHz (internal), either divided to 1 MHz, times
// 336, by 2 for the core.
void StartClock() {
  RccRegisters& rcc = Rcc();
  Set(rcc.CR, kRccCrHseOn);
  std::uint32_t tries = kCrystalTries;
  while ((rcc.CR & kRccCrHseReady) == 0 && --tries != 0) {
  }
  crystal_runs = tries != 0;

  Set(rcc.APB1ENR, kRccApb1Pwr);
  Set(Pwr().CR, kPwrCrVos);
  constexpr std::uint32_t kTimes336 = 336 << 6, kBy2 = 0 << 16, kUsbBy7 = 7 << 24, kFromHse = Bit(22);
  rcc.PLLCFGR = kTimes336 | kBy2 | kUsbBy7 | (crystal_runs ? kFromHse | 8 : 16);
  Set(rcc.CR, kRccCrPllOn);
  while ((rcc.CR & kRccCrPllReady) == 0) {
  }
  // 5 wait states at 168 MHz and 2.7 V to 3.6 V (section 3.5.1), before the clock rises.
  constexpr std::uint32_t kWaitStates = 5;
  Flash().ACR = kWaitStates | kFlashAcrPrefetch | kFlashAcrInstructionCache | kFlashAcrDataCache;
  while ((Flash().ACR & 7) != kWaitStates) {
  }
  rcc.CFGR = kRccCfgrApb1Div4 | kRccCfgrApb2Div2 | kRccCfgrSwPll;
  while ((rcc.CFGR & kRccCfgrSwsMask) != kRccCfgrSwsPll) {
  }
}

// Alternate function 7 is the USARTs 1 to 3 (data sheet DS8626, alternate functions). A receiver without adapter idles high
// instead of receiving noise.
void StartPins() {
  Set(Rcc().AHB1ENR, kRccAhb1GpioA | kRccAhb1GpioB | kRccAhb1GpioD);
  Set(Rcc().APB1ENR, kRccApb1Usart2 | kRccApb1Usart3);
  Set(Rcc().APB2ENR, kRccApb2Usart1);
  DataBarrier();
  constexpr unsigned kUsart = 7;
  SetPin(GpioA(), 2, PinMode::kAlternate, kUsart, Pull::kUp);  // USART2 TX
  SetPin(GpioA(), 3, PinMode::kAlternate, kUsart, Pull::kUp);  // USART2 RX
  SetPin(GpioD(), 8, PinMode::kAlternate, kUsart, Pull::kUp);  // USART3 TX
  SetPin(GpioD(), 9, PinMode::kAlternate, kUsart, Pull::kUp);  // USART3 RX
  // PB6 is also the audio codec's I2C clock: the codec is kept in reset (PD4 low), so that it never answers to
  // what looks like an address.
  GpioD().BSRR = Bit(4 + 16);
  SetPin(GpioD(), 4, PinMode::kOutput, 0, Pull::kNone);
  SetPin(GpioB(), 6, PinMode::kAlternate, kUsart, Pull::kUp);  // USART1 TX
}

ResetReason TakeResetReason() {
  const std::uint32_t flags = Rcc().CSR;
  Set(Rcc().CSR, kRccCsrRemoveFlags);
  if ((flags & kRccCsrIwdg) != 0) return ResetReason::kWatchdog;
  if ((flags & kRccCsrSoftware) != 0) return ResetReason::kSoftware;
  if ((flags & kRccCsrPowerOn) != 0) return ResetReason::kPowerOn;
  return (flags & kRccCsrPin) != 0 ? ResetReason::kPin : ResetReason::kPowerOn;
}

}  // namespace

ResetReason StartBoard() {
  const ResetReason reason = TakeResetReason();
  // Faults with a handler of their own instead of one hard fault for all, and a division by zero is one.
  Set(Scb().SHCSR, kScbShcsrMemoryFault | kScbShcsrBusFault | kScbShcsrUsageFault);
  Set(Scb().CCR, kScbCcrDivideByZero);
  StartClock();
  StartPins();
  Set(DbgmcuApb1Freeze(), kDbgmcuIwdg);  // a breakpoint is no reset
  return reason;
}

bool CrystalRuns() { return crystal_runs; }

void StartTicks() {
  Scb().SHPR[kExceptionSysTick - 4] = Priority(kTickPriority);
  SysTick().LOAD = kCyclesPerTick - 1;
  SysTick().VAL = 0;
  SysTick().CTRL = kSysTickCoreClock | kSysTickInterrupt | kSysTickEnable;
  while (SysTick().VAL == 0) {  // it counts from the next cycle on
  }
}

void CountTick() {
  const InterruptLock lock;  // 64 bits: the USARTs' handlers interrupt this one
  ++tick_count;
}

TimeNs TickTime() {
  const InterruptLock lock;
  return tick_count * kTickNs;
}

TimeNs Now() {
  const InterruptLock lock;
  if ((SysTick().CTRL & kSysTickEnable) == 0) return 0;
  std::int64_t ticks = tick_count;
  std::uint32_t cycles = kCyclesPerTick - SysTick().VAL;
  if ((Scb().ICSR & kScbIcsrSysTickPending) != 0) {
    // The tick has come, perhaps after the counter was read, and is not counted yet. At the tick itself the
    // counter is 0.
    ++ticks;
    cycles = (kCyclesPerTick - SysTick().VAL) % kCyclesPerTick;
  }
  constexpr std::uint32_t kCyclesPerUs = kCoreHz / 1'000'000;
  return ticks * kTickNs + cycles * 1000 / kCyclesPerUs;
}

void AwaitMiddleOfTick() {
  while (Now() % kTickNs < kTickNs / 2) {
  }
}

void StartWatchdog() {
  // 32 kHz / 4, 800 counts. The status says when a new value has crossed into the watchdog's clock.
  IwdgRegisters& iwdg = Iwdg();
  iwdg.KR = kIwdgStart;
  iwdg.KR = kIwdgUnlock;
  iwdg.PR = 0;
  iwdg.RLR = 800 - 1;
  while (iwdg.SR != 0) {
  }
  FeedWatchdog();
}

void FeedWatchdog() { Iwdg().KR = kIwdgFeed; }

void ResetBoard() {
  DataBarrier();
  Scb().AIRCR = kScbAircrReset;
  DataBarrier();
  for (;;) {
  }
}

}  // namespace tiltproof::stm32f4
