// The largest use of the processor and of the stacks in a flight: `tiltproof_run_statistics` (symbols.h), and
// a few lines on the console one second after the start and then every 10 s.
//
//   AddStack("main", main_stack);          // before the start; painted with kStackPaint
//   BeginBusy(); ... EndBusy();            // around work, with all interrupts that come meanwhile
//   PrintRunStatistics();                  // in idle time; does nothing until it is time
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace tiltproof::stm32f4 {

// FreeRTOS paints its tasks' stacks with the same bytes.
inline constexpr std::uint32_t kStackPaint = 0xA5A5'A5A5;

void AddStack(std::string_view name, std::span<const std::uint32_t> words);
// The stack of [_sstack, _estack), painted by the start-up.
void AddMainStack();

// An interrupt that wakes nothing is no work: reading the clock twice would take longer than it does.
void BeginBusy();
void EndBusy();
// From an interrupt that sets work going: begins, unless some is under way.
void NoteWork();

void PrintRunStatistics();

}  // namespace tiltproof::stm32f4
