// Registers of the STM32F405/407 and of its Cortex-M4 that the images use, and no more.
//
// Sources: RM0090 (STM32F405/407 reference manual) for the chip, PM0214 (Cortex-M4 programming manual) for
// the core; names are theirs. Debian packages no vendor headers for this chip.
//
//   Set(Rcc().APB1ENR, kRccApb1Usart2);
#pragma once

#include <cstdint>

namespace tiltproof::stm32f4 {

using Register = volatile std::uint32_t;

// Compound assignment to a volatile is deprecated in C++20.
inline void Set(Register& place, std::uint32_t bits) { place = place | bits; }
inline void Clear(Register& place, std::uint32_t bits) { place = place & ~bits; }
inline void Modify(Register& place, std::uint32_t mask, std::uint32_t bits) {
  place = (place & ~mask) | bits;
}

constexpr std::uint32_t Bit(unsigned number) { return std::uint32_t{1} << number; }

// --- Reset and clock control (RM0090, section 7.3) at 0x40023800.
struct RccRegisters {
  Register CR, PLLCFGR, CFGR, CIR, AHB1RSTR, AHB2RSTR, AHB3RSTR, reserved0, APB1RSTR, APB2RSTR, reserved1[2];
  Register AHB1ENR, AHB2ENR, AHB3ENR, reserved2, APB1ENR, APB2ENR, reserved3[2];
  Register AHB1LPENR, AHB2LPENR, AHB3LPENR, reserved4, APB1LPENR, APB2LPENR, reserved5[2], BDCR, CSR;
};
static_assert(sizeof(RccRegisters) == 0x78);
inline RccRegisters& Rcc() { return *reinterpret_cast<RccRegisters*>(0x40023800); }

inline constexpr std::uint32_t kRccCrHseOn = Bit(16), kRccCrHseReady = Bit(17);
inline constexpr std::uint32_t kRccCrPllOn = Bit(24), kRccCrPllReady = Bit(25);
inline constexpr std::uint32_t kRccCfgrSwMask = 3, kRccCfgrSwPll = 2;
inline constexpr std::uint32_t kRccCfgrSwsMask = 3 << 2, kRccCfgrSwsPll = 2 << 2;
inline constexpr std::uint32_t kRccCfgrApb1Div4 = 5 << 10, kRccCfgrApb2Div2 = 4 << 13;
inline constexpr std::uint32_t kRccAhb1GpioA = Bit(0), kRccAhb1GpioB = Bit(1), kRccAhb1GpioC = Bit(2),
                               kRccAhb1GpioD = Bit(3);
inline constexpr std::uint32_t kRccApb1Tim2 = Bit(0), kRccApb1Usart2 = Bit(17), kRccApb1Usart3 = Bit(18),
                               kRccApb1Uart4 = Bit(19);
inline constexpr std::uint32_t kRccApb1Pwr = Bit(28);
inline constexpr std::uint32_t kRccApb2Usart1 = Bit(4), kRccApb2Usart6 = Bit(5);
// Reset causes of the chip (7.3.21). The watchdog's and the software's resets set the pin's flag too.
inline constexpr std::uint32_t kRccCsrRemoveFlags = Bit(24), kRccCsrPin = Bit(26), kRccCsrPowerOn = Bit(27);
inline constexpr std::uint32_t kRccCsrSoftware = Bit(28), kRccCsrIwdg = Bit(29);

// --- Power controller (5.4), flash interface (3.9).
struct PwrRegisters {
  Register CR, CSR;
};
inline PwrRegisters& Pwr() { return *reinterpret_cast<PwrRegisters*>(0x40007000); }
inline constexpr std::uint32_t kPwrCrVos = Bit(14);  // voltage scale 1: up to 168 MHz

struct FlashRegisters {
  Register ACR;
};
inline FlashRegisters& Flash() { return *reinterpret_cast<FlashRegisters*>(0x40023C00); }
inline constexpr std::uint32_t kFlashAcrPrefetch = Bit(8), kFlashAcrInstructionCache = Bit(9),
                               kFlashAcrDataCache = Bit(10);

// --- General-purpose pins (8.4).
struct GpioRegisters {
  Register MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFR[2];
};
inline GpioRegisters& GpioA() { return *reinterpret_cast<GpioRegisters*>(0x40020000); }
inline GpioRegisters& GpioB() { return *reinterpret_cast<GpioRegisters*>(0x40020400); }
inline GpioRegisters& GpioC() { return *reinterpret_cast<GpioRegisters*>(0x40020800); }
inline GpioRegisters& GpioD() { return *reinterpret_cast<GpioRegisters*>(0x40020C00); }

// --- USART (30.6).
struct UsartRegisters {
  Register SR, DR, BRR, CR1, CR2, CR3, GTPR;
};
inline UsartRegisters& Usart1() { return *reinterpret_cast<UsartRegisters*>(0x40011000); }
inline UsartRegisters& Usart2() { return *reinterpret_cast<UsartRegisters*>(0x40004400); }
inline UsartRegisters& Usart3() { return *reinterpret_cast<UsartRegisters*>(0x40004800); }
inline UsartRegisters& Uart4() { return *reinterpret_cast<UsartRegisters*>(0x40004C00); }
inline UsartRegisters& Usart6() { return *reinterpret_cast<UsartRegisters*>(0x40011400); }
inline constexpr std::uint32_t kUsartSrFramingError = Bit(1), kUsartSrNoise = Bit(2),
                               kUsartSrOverrun = Bit(3), kUsartSrReceived = Bit(5),
                               kUsartSrTransmitEmpty = Bit(7);
inline constexpr std::uint32_t kUsartCr1Receive = Bit(2), kUsartCr1Transmit = Bit(3),
                               kUsartCr1ReceivedInterrupt = Bit(5), kUsartCr1TransmitEmptyInterrupt = Bit(7),
                               kUsartCr1Enable = Bit(13);

// --- Independent watchdog (21.4).
struct IwdgRegisters {
  Register KR, PR, RLR, SR;
};
inline IwdgRegisters& Iwdg() { return *reinterpret_cast<IwdgRegisters*>(0x40003000); }
inline constexpr std::uint32_t kIwdgStart = 0xCCCC, kIwdgUnlock = 0x5555, kIwdgFeed = 0xAAAA;

// --- Timer 2 (18.4), 32 bits.
struct TimerRegisters {
  Register CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR;
};
inline TimerRegisters& Tim2() { return *reinterpret_cast<TimerRegisters*>(0x40000000); }

// --- Debug support (38.16): what stands still while a debugger has stopped the core.
inline Register& DbgmcuApb1Freeze() { return *reinterpret_cast<Register*>(0xE0042008); }
inline constexpr std::uint32_t kDbgmcuIwdg = Bit(12);

// --- Core: SysTick (PM0214, 4.5).
struct SysTickRegisters {
  Register CTRL, LOAD, VAL, CALIB;
};
inline SysTickRegisters& SysTick() { return *reinterpret_cast<SysTickRegisters*>(0xE000E010); }
inline constexpr std::uint32_t kSysTickEnable = Bit(0), kSysTickInterrupt = Bit(1),
                               kSysTickCoreClock = Bit(2);

// --- Core: system control block (4.4).
struct ScbRegisters {
  Register CPUID, ICSR, VTOR, AIRCR, SCR, CCR;
  volatile std::uint8_t SHPR[12];  // priorities of exceptions 4 to 15
  Register SHCSR, CFSR, HFSR, DFSR, MMFAR, BFAR;
};
inline ScbRegisters& Scb() { return *reinterpret_cast<ScbRegisters*>(0xE000ED00); }
inline constexpr std::uint32_t kScbIcsrSysTickPending = Bit(26);
inline constexpr std::uint32_t kScbAircrReset = 0x05FA'0004;  // write key and SYSRESETREQ
inline constexpr std::uint32_t kScbCcrDivideByZero = Bit(4);
inline constexpr std::uint32_t kScbShcsrMemoryFault = Bit(16), kScbShcsrBusFault = Bit(17),
                               kScbShcsrUsageFault = Bit(18);
inline constexpr unsigned kExceptionPendSv = 14, kExceptionSysTick = 15;

// Floating point: full access for both privilege levels (4.6.1).
inline Register& Cpacr() { return *reinterpret_cast<Register*>(0xE000ED88); }
inline constexpr std::uint32_t kCpacrFpu = 0xFU << 20;

// --- Core: interrupt controller (4.3). Numbers: RM0090, table 62.
inline constexpr unsigned kIrqUsart1 = 37, kIrqUsart2 = 38, kIrqUsart3 = 39, kIrqUart4 = 52, kIrqUsart6 = 71,
                          kIrqCount = 82;
inline Register& NvicEnable(unsigned irq) {
  return reinterpret_cast<Register*>(0xE000E100)[irq / 32];  // ISER
}
inline volatile std::uint8_t& NvicPriority(unsigned irq) {
  return reinterpret_cast<volatile std::uint8_t*>(0xE000E400)[irq];  // IPR
}
// The chip has the upper 4 bits of a priority: 0 is the most urgent, 15 the least.
constexpr std::uint8_t Priority(unsigned level) { return static_cast<std::uint8_t>(level << 4); }

// --- Core: instructions.
inline void WaitForInterrupt() { asm volatile("wfi" ::: "memory"); }
inline void DisableInterrupts() { asm volatile("cpsid i" ::: "memory"); }
inline void EnableInterrupts() { asm volatile("cpsie i\n\tisb" ::: "memory"); }
inline void DataBarrier() { asm volatile("dsb" ::: "memory"); }
inline void InstructionBarrier() { asm volatile("isb" ::: "memory"); }

// Disables interrupts while it exists, also within another one. For a few microseconds at most: a USART's
// next byte is lost 11 us after the last.
class InterruptLock {
 public:
  InterruptLock() {
    asm volatile("mrs %0, primask" : "=r"(primask_));
    DisableInterrupts();
  }
  ~InterruptLock() { asm volatile("msr primask, %0" ::"r"(primask_) : "memory"); }
  InterruptLock(const InterruptLock&) = delete;
  InterruptLock& operator=(const InterruptLock&) = delete;

 private:
  std::uint32_t primask_;
};

}  // namespace tiltproof::stm32f4
