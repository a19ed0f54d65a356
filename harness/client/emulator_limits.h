// Limits on what an image may do to the emulated board. No sound image meets them: how much processor time it may cost, how
// often it may reset itself, and which clocks it may set.
//
//   EmulatorLimits limits;
//   const lockstep::Run run{until, answer_after, answer_after, limits.LeftForTurn()};
//   board.Run(run, on_message);                            // calls OnReset(), OnBrokenLimit()
//   if (!limits.Broken(time_text).empty()) throw ...;
//   if (limits.CostsTooMuch(now, board.ProcessorTime())) throw ...;
//
// Times are virtual; only processor time depends on the machine.
#pragma once

#include <functional>
#include <string>

#include "link/time.h"

namespace tiltproof::harness {

class EmulatorLimits {
 public:
  // The emulator may compute for so long for each second of virtual time.
  static constexpr TimeNs kProcessorNsPerSecond = 10 * kNsPerS;
  // A turn ends after this time. An emulator that has not answered a little later has failed by itself.
  static constexpr TimeNs kTurnNs = 4 * kNsPerS;
  // So many times the firmware may reset itself, or let its watchdog do it, within so much virtual time.
  static constexpr int kResetsMax = 100;
  static constexpr TimeNs kResetsWithinNs = 10 * kNsPerS;

  // The processor time that the next turn may take.
  TimeNs LeftForTurn() const;
  // After a turn: whether the present second has cost too much. `used_ns`: processor time since the emulator's start.
  bool CostsTooMuch(TimeNs now, TimeNs used_ns);
  // The present second, if it did: its begin, and what it has cost until now.
  TimeNs second_begin() const { return second_begin_; }
  TimeNs second_cost_ns() const { return used_ns_ - used_before_ns_; }

  // The firmware was reset, by itself. `cause`: as the user reads it.
  void OnReset(TimeNs now, const std::string& cause);
  // It has set what no chip does.
  void OnBrokenLimit(TimeNs now, const std::string& what);
  // The reason that the firmware has failed by now; empty: it has not. `time_text`: a time as a user reads it.
  std::string Broken(const std::function<std::string(TimeNs)>& time_text) const;

 private:
  TimeNs second_begin_ = 0, used_before_ns_ = 0, used_ns_ = 0;
  TimeNs resets_begin_ = 0, resets_end_ = 0;
  int resets_count_ = 0;
  std::string last_reset_;
  std::string broken_limit_;
  TimeNs broken_limit_at_ = 0;
};

}  // namespace tiltproof::harness
