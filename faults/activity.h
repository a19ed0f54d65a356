// When a fault is active: inside its window, and there, when it is periodic, in the first part of each period.
//
//   period_s   |<----------->|<----------->|<----
//   active     ######________######________####
//              start_s                        end_s
//
//   Activity activity(spec);                      // in simulation time
//   if (activity.Contains(t)) ...                 // a sample at t
//   if (activity.Touches(begin, end)) ...         // a byte on the line from begin to end
//   wake_at = activity.NextEdge(t);               // when the answer may change next
//
// A fault may wait for others to open its window (`after`), and for a condition (`when`): what it hears of them narrows
// this further. An `after`, or a condition whose edge is `rising`, moves the window's begin; a condition with `level` opens
// and closes inside.
//
// A periodic fault is one fault: one id, one random stream, one count of what it saw. Periods are counted in
// whole nanoseconds from start_s (of a fault with `after` and without start_s: from where its window opens), so the last
// of a long flight begins as exactly as the first.
#pragma once

#include <vector>

#include "faults/fault.h"
#include "link/time.h"

namespace tiltproof::faults {

// [begin, end)
struct Window {
  TimeNs begin_ns = kPowerOn;
  TimeNs end_ns = kNever;
  bool Contains(TimeNs t) const { return begin_ns <= t && t < end_ns; }
};

class Activity {
 public:
  // Of a valid fault with that window. All times here are simulation time; kPowerOn asks for before t = 0 is known, when
  // windows without a begin are open.
  Activity(const FaultSpec& spec, const Window& window);

  bool Contains(TimeNs t) const;
  // Whether it is active at some time of [begin, end), or at `begin` when the two are equal.
  bool Touches(TimeNs begin, TimeNs end) const;
  // The next time after `t` at which Contains() may change, as far as is known; kNever when there is none.
  TimeNs NextEdge(TimeNs t) const;
  // Where it is active, in order. Of a periodic fault, its window must have an end.
  std::vector<Window> Stretches() const;

  // From the begin of its window to the end of the last stretch in it.
  Window Span() const;

  // `after`: the fault that it follows acted first at `t`.
  void OnFollowed(TimeNs t);
  // `when`: from `t` on the condition holds, or does not. Times ascend; only changes are told.
  void OnCondition(TimeNs t, bool holds);

 private:
  // Changes of a condition that are remembered: 12 ms apart, they reach further back than any frame waits for its turn.
  static constexpr std::size_t kChangesMax = 64;

  // As stated, from where what it waits for has opened it; empty before.
  Window OpenWindow() const;
  TimeNs Phase(TimeNs t) const;
  // By window and period alone.
  bool IsInTurn(TimeNs t) const;
  TimeNs NextTurn(TimeNs t) const;
  TimeNs NextTurnEdge(TimeNs t) const;
  bool ConditionHolds(TimeNs t) const;

  Window window_;
  TimeNs period_ns_;  // kNever: active throughout the window
  TimeNs active_ns_;  // of each period
  TimeNs delay_ns_;
  TimeNs
      followed_ns_;  // the delay after what it follows; kPowerOn: it follows nothing, kNever: not yet known
  TimeNs risen_ns_;  // where its condition rose; likewise
  bool by_level_;
  std::vector<TimeNs>
      changes_;  // of a condition by level: true from the first on, false from the second, ...
};

}  // namespace tiltproof::faults
