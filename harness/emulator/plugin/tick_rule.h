// Tells which ticks of a timer a firmware could not see since this machine had no time for the emulator. A tick that
// comes while the one before is still pending is lost. The firmware loses it itself while it executes with its interrupts
// off; this machine took it when the thread that executes the firmware hardly ran.
//
//   TickRule rule;
//   const auto lost = rule.Tick({.at_ns = 2'000'000, .run_ns = 1'000, .pending = true});
//   const std::int64_t taken_ns = lost ? lost->end_ns - lost->begin_ns : 0;
#pragma once

#include <cstdint>
#include <optional>

namespace tiltproof::qemu {

class TickRule {
 public:
  // run_ns: how long the processor's thread has run since it began. pending: the firmware has not yet taken the tick
  // before.
  struct Now {
    std::int64_t at_ns, run_ns;
    bool pending;
  };
  // In which this machine took the time.
  struct Span {
    std::int64_t begin_ns, end_ns;
  };

  // `began`: when the processor began to run; nothing was lost before.
  explicit TickRule(const Now& began = {}) : before_(began), idle_since_ns_(began.at_ns) {}

  // To be called at each tick, in order of time. A span when this machine took the tick.
  std::optional<Span> Tick(const Now& now);

 private:
  Now before_;  // the tick before
  // The last tick before those that came at once with that one, if the thread hardly ran since it; otherwise that one.
  std::int64_t idle_since_ns_;
};

}  // namespace tiltproof::qemu
