// Computes the time up to which a formula must look before it can be decided.
#include <algorithm>
#include <limits>

#include "harness/score/signals.h"
#include "harness/score/stl.h"
#include "link/check.h"

namespace tiltproof::harness::stl {
namespace {

constexpr TimeNs kNeverDecided = std::numeric_limits<TimeNs>::max();

// Else it is known before the flight, as 1 < 2 is.
bool ReadsTheFlight(const Node& node) {
  return node.op == Op::kSignal || node.op == Op::kFaultActive || (node.left && ReadsTheFlight(*node.left)) ||
         (node.right && ReadsTheFlight(*node.right));
}

// The earliest time at which `formula`, evaluated at `time_ns`, can be known to have the truth `wanted`.
class Horizon {
 public:
  explicit Horizon(TimeNs planned_end_ns) : planned_end_ns_(planned_end_ns) {}

  TimeNs Earliest(const Formula& formula, bool wanted, TimeNs time_ns) const {
    const auto left = [&](bool truth, TimeNs at) { return Earliest(formula->left, truth, at); };
    const auto right = [&](bool truth, TimeNs at) { return Earliest(formula->right, truth, at); };
    switch (formula->op) {
      case Op::kTrue:
        return wanted ? 0 : kNeverDecided;
      case Op::kFalse:
        return wanted ? kNeverDecided : 0;
      case Op::kNot:
        return left(!wanted, time_ns);
      case Op::kAnd:
        return Both(wanted, left(wanted, time_ns), right(wanted, time_ns));
      case Op::kOr:
        return Both(!wanted, left(wanted, time_ns), right(wanted, time_ns));
      case Op::kImplies:
        return Both(!wanted, left(!wanted, time_ns), right(wanted, time_ns));
      case Op::kAlways:  // one row violates it, all of them fulfil it
        return left(wanted, wanted ? End(*formula, time_ns) : Begin(*formula, time_ns));
      case Op::kEventually:
        return left(wanted, wanted ? Begin(*formula, time_ns) : End(*formula, time_ns));
      case Op::kUntil:  // the left side may give way at once, the right side only over the whole window
        return wanted ? right(true, Begin(*formula, time_ns))
                      : std::min(left(false, time_ns), right(false, End(*formula, time_ns)));
      case Op::kFaultActive:
        return ReadsTheFlight(*formula) ? time_ns : 0;
      default:
        Check(IsComparison(formula->op), "an operator that makes a formula");
        return ReadsTheFlight(*formula) ? time_ns : 0;
    }
  }

 private:
  static TimeNs Both(bool both_needed, TimeNs a, TimeNs b) {
    return both_needed ? std::max(a, b) : std::min(a, b);
  }
  static TimeNs Begin(const Node& node, TimeNs time_ns) {
    return node.window ? time_ns + node.window->begin_ns : time_ns;
  }
  TimeNs End(const Node& node, TimeNs time_ns) const {
    return node.window ? time_ns + node.window->end_ns : std::max(planned_end_ns_, time_ns);
  }

  TimeNs planned_end_ns_;
};

}  // namespace

TimeNs EarliestDecision(const Formula& formula, TimeNs planned_end_ns) {
  const Horizon horizon(planned_end_ns);
  return std::min(horizon.Earliest(formula, true, 0), horizon.Earliest(formula, false, 0));
}

}  // namespace tiltproof::harness::stl
