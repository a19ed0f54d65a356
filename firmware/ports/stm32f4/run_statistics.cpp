#include "firmware/ports/stm32f4/run_statistics.h"

#include <algorithm>
#include <array>

#include "firmware/ports/stm32f4/board.h"
#include "firmware/ports/stm32f4/console.h"
#include "firmware/ports/stm32f4/stm32f4.h"
#include "firmware/ports/stm32f4/symbols.h"

TiltproofRunStatistics tiltproof_run_statistics;

extern "C" const std::uint32_t _sstack, _estack;  // stm32f4.ld

namespace tiltproof::stm32f4 {
namespace {

constexpr TimeNs kPrintPeriodNs = 10 * kNsPerS;

std::array<std::span<const std::uint32_t>, TILTPROOF_STACKS_MAX> stacks;
std::uint32_t stack_count = 0;
bool busy = false;
TimeNs busy_since_ns = 0;
TimeNs print_ns = kNsPerS;

// Stacks grow downwards: the first word that is not paint any more is the deepest use.
std::uint32_t UsedBytesMax(std::span<const std::uint32_t> words) {
  const auto deepest =
      std::find_if(words.begin(), words.end(), [](std::uint32_t w) { return w != kStackPaint; });
  return static_cast<std::uint32_t>((words.end() - deepest) * 4);
}

}  // namespace

void AddStack(std::string_view name, std::span<const std::uint32_t> words) {
  if (stack_count == stacks.size()) return;
  TiltproofStackStatistics& statistics = tiltproof_run_statistics.stacks[stack_count];
  for (std::size_t i = 0; i < name.size() && i < sizeof(statistics.name) - 1; ++i)
    statistics.name[i] = name[i];
  statistics.bytes = static_cast<std::uint32_t>(words.size_bytes());
  stacks[stack_count++] = words;
}

void AddMainStack() { AddStack("main", {&_sstack, &_estack}); }

void BeginBusy() {
  busy = true;
  busy_since_ns = Now();
  ++tiltproof_run_statistics.wakeups_count;
}

void NoteWork() {
  const InterruptLock lock;
  if (!busy) BeginBusy();
}

void EndBusy() {
  if (!busy) return;
  busy = false;
  // Signed: an emulator that has fallen behind the wall clock loses ticks, and time may step back.
  const TimeNs busy_ns = Now() - busy_since_ns;
  std::uint32_t& busy_ns_max = tiltproof_run_statistics.busy_ns_max;
  if (busy_ns > static_cast<TimeNs>(busy_ns_max)) busy_ns_max = static_cast<std::uint32_t>(busy_ns);
}

void PrintRunStatistics() {
  if (TickTime() < print_ns) return;
  print_ns += kPrintPeriodNs;
  EndBusy();  // this is not the flight's work
  for (std::uint32_t i = 0; i < stack_count; ++i) {
    TiltproofStackStatistics& statistics = tiltproof_run_statistics.stacks[i];
    statistics.used_bytes_max = UsedBytesMax(stacks[i]);
    ConsoleLine line("stack ");
    line.Text(statistics.name).Text(" ").Number(statistics.used_bytes_max);
    line.Text(" of ").Number(statistics.bytes).Text(" bytes").Send();
  }
  ConsoleLine line("busy for ");
  line.Number(tiltproof_run_statistics.busy_ns_max).Text(" ns at most").Send();
  BeginBusy();
}

}  // namespace tiltproof::stm32f4
