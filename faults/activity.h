// When a fault is active: inside its window; if it is periodic, only in the first part of each period there.
//
//   period_s   |<----------->|<----------->|<----
//   active     ######________######________####
//              start_s                        end_s
//
//   Activity activity(spec, window);              // in simulation time
//   if (activity.Contains(t)) ...                 // a sample at t
//   if (activity.Touches(begin, end)) ...         // a byte on the line from begin to end
//   wake_at = activity.NextEdge(t);               // when the answer may change next
//
// A fault may wait for another fault to open its window (`after`), or for a condition (`when`). This narrows
// its active time further. An `after`, or a condition whose edge is `rising`, moves the window's begin; a
// condition with `level` opens and closes inside the window.
//
// A periodic fault is one fault: one id, one random stream, one count of what it saw. Periods are counted in
// whole nanoseconds from start_s (for a fault with `after` and without start_s: from where its window opens),
// so the last period of a long flight begins as exactly as the first.
#pragma once

#include <algorithm>
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
  // For a valid fault with that window. All times here are simulation time; kPowerOn asks about the time
  // before t = 0 is known, when windows without a begin are open.
  Activity(const FaultSpec& spec, const Window& window);

  bool Contains(TimeNs t) const;
  // True if it is active at any time in [begin, end), or at `begin` when the two are equal.
  bool Touches(TimeNs begin, TimeNs end) const;
  // The next time after `t` at which Contains() may change, as far as known; kNever when there is none.
  TimeNs NextEdge(TimeNs t) const;
  // The intervals in which it is active, in order. The window of a periodic fault must have an end.
  std::vector<Window> Stretches() const;

  // From the begin of its window to the end of the last active interval in it.
  Window Span() const;

  // `after`: the fault that this one follows first acted at `t`.
  void OnFollowed(TimeNs t);
  // `when`: from `t` on the condition holds, or does not hold. Times ascend; only changes are reported.
  void OnCondition(TimeNs t, bool holds);
  // Ends its window at `t`, unless that ends earlier.
  void OnCut(TimeNs t) { window_.end_ns = std::min(window_.end_ns, t); }

 private:
  // Number of changes of a condition that are remembered. At 12 ms apart, they reach further back than any
  // frame is delayed.
  static constexpr std::size_t kChangesMax = 64;

  // The window as stated, beginning where the awaited event opened it; empty before.
  Window OpenWindow() const;
  TimeNs Phase(TimeNs t) const;
  // Considers only window and period.
  bool IsInActivePart(TimeNs t) const;
  TimeNs NextActivePart(TimeNs t) const;
  TimeNs NextPartEdge(TimeNs t) const;
  bool ConditionHolds(TimeNs t) const;

  Window window_;
  TimeNs period_ns_;  // kNever: active throughout the window
  TimeNs active_ns_;  // of each period
  TimeNs delay_ns_;
  TimeNs
      followed_ns_;  // where the followed fault opens the window; kPowerOn: follows nothing, kNever: not yet known
  TimeNs risen_ns_;  // where its condition rose; same special values
  bool by_level_;
  std::vector<TimeNs>
      changes_;  // of a condition by level: true from the first on, false from the second, ...
};

}  // namespace tiltproof::faults
