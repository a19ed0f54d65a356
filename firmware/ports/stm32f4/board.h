// The board: STM32F407 Discovery (MB997), or its emulation.
//
//   const ResetReason reason = StartBoard();   // clock, pins, faults; once, first thing in main()
//   StartTicks();                              // 1 kHz (with FreeRTOS the kernel does it)
//   StartWatchdog();                           // from now on FeedWatchdog() at least every 68 ms
//   const TimeNs now = Now();
#pragma once

#include <cstdint>

#include "link/time.h"

namespace tiltproof::stm32f4 {

inline constexpr std::uint32_t kCoreHz = 168'000'000;
inline constexpr std::uint32_t kApb1Hz = kCoreHz / 4;
inline constexpr std::uint32_t kApb2Hz = kCoreHz / 2;
inline constexpr std::uint32_t kTickHz = 1000;
inline constexpr TimeNs kTickNs = kNsPerS / kTickHz;

// Priorities of interrupts, 0 the most urgent (FreeRTOS masks from 5 on). The ticks wait for bytes: a byte is lost
// after 11 us, a tick after 1 ms.
inline constexpr unsigned kUsartPriority = 6;
inline constexpr unsigned kTickPriority = 15;

enum class ResetReason : std::uint8_t { kPowerOn, kPin, kWatchdog, kSoftware };

ResetReason StartBoard();

// False when the 8 MHz crystal did not start and the core runs from the internal oscillator (1 % off).
bool CrystalRuns();

// --- Time since StartTicks(). CountTick() belongs into SysTick_Handler, and nowhere else.
void StartTicks();
void CountTick();
// The time of the last tick: a multiple of 1 ms. It is the application's time: a period begins at a tick, and
// a time-out of n ms ends n ticks later.
TimeNs TickTime();
// To the cycle. Not from an interrupt.
TimeNs Now();
// Spins until half of the current tick is over. `start` is sent then and requests at ticks, so requests keep
// half a tick away from the plant's grid, which counts from the arrival of `start`. This board's clock may
// gain or lose that much before a request falls into the previous or next step.
void AwaitMiddleOfTick();

// --- Independent watchdog (RM0090, section 21): resets the chip when it is not fed for 100 ms (68 to 188 ms,
// for its clock is only good for 17 to 47 kHz). Once started nothing but a reset stops it.
void StartWatchdog();
void FeedWatchdog();

[[noreturn]] void ResetBoard();

}  // namespace tiltproof::stm32f4
