// Bottom up, each formula becomes two columns over the rows of the trace: bounds of its robustness whatever
// the rest of the flight.
//
// Behind the last row stands one more, "the future": all that was not seen. There a comparison of signals
// lies anywhere between minus and plus infinity, and every window that reaches past the last row includes it.
// So the three-valued logic needs no cases of its own: bounds of a minimum are the minimum of bounds.
//
// The sign of a zero says whether it holds: +0 does (x <= 1 at x = 1), -0 does not (x < 1). With -0 ordered
// before +0, minimum, maximum and negation carry this through, and "holds" is the sign bit alone. A NaN never
// gets past a comparison.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "harness/score/signals.h"
#include "harness/score/sliding_fold.h"
#include "harness/score/stl.h"
#include "harness/score/stl_reading.h"
#include "link/check.h"

namespace tiltproof::harness::stl {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool Holds(double robustness) { return !std::signbit(robustness); }
bool Less(double a, double b) { return a < b || (a == b && std::signbit(a) && !std::signbit(b)); }

struct Lowest {
  double operator()(double a, double b) const { return Less(b, a) ? b : a; }
};
struct Highest {
  double operator()(double a, double b) const { return Less(a, b) ? b : a; }
};

// "stay until reach" over a run of rows: the worst of stay in it, and the best that reach attains with stay
// holding before.
struct Until {
  double stay = kInfinity;
  double reach = -kInfinity;
};
struct ThenUntil {
  Until operator()(const Until& a, const Until& b) const {
    return {Lowest()(a.stay, b.stay), Highest()(a.reach, Lowest()(a.stay, b.reach))};
  }
};

// A number that is "a lot" of this expression; without a signal in it, its value.
struct Scale {
  bool has_signal = false;
  double value = 1.0;
};

Scale ScaleOf(const Trace& trace, const Node& node) {
  if (node.op == Op::kNumber) return {false, node.number};
  if (node.op == Op::kSignal) return {true, SignalScale(trace, node.name)};
  const Scale left = ScaleOf(trace, *node.left);
  const Scale right = node.right ? ScaleOf(trace, *node.right) : Scale{false, 0.0};
  if (!left.has_signal && !right.has_signal) return {false, Apply(node.op, left.value, right.value)};
  if (node.op == Op::kMultiply || node.op == Op::kDivide) {
    // A constant factor stretches the scale with the signal; any other product is of no unit that the table
    // knows.
    double scale = 1.0;
    if (!right.has_signal)
      scale = std::abs(Apply(node.op, left.value, right.value));
    else if (!left.has_signal && node.op == Op::kMultiply)
      scale = std::abs(left.value * right.value);
    return {true, std::isfinite(scale) && scale > 0.0 ? scale : 1.0};
  }
  return {true, std::max(left.has_signal ? left.value : 0.0, right.has_signal ? right.value : 0.0)};
}

// Bounds of a formula's robustness, whatever the part of the flight that was not seen.
struct Bounds {
  std::vector<double> lower, upper;  // one per row, then one for the future
  const std::vector<double>& Of(bool upper_side) const { return upper_side ? upper : lower; }
};

struct Evaluation {
  const Node& node;
  Bounds bounds;
  std::vector<Evaluation> operands;
};

// Rows [first, last) that a window looks at.
struct Rows {
  std::size_t first = 0, last = 0;
};

// The row, and the part of the formula without operators, that an answer rests on.
struct Decider {
  std::size_t row;
  const Node* leaf;
};

class Monitor {
 public:
  Monitor(const Trace& trace, const std::optional<Extent>& extent)
      : trace_(trace), times_(RowTimes(trace)), future_(times_.size()) {
    more_to_come_ = times_.empty();
    if (times_.empty()) return;
    Check(std::adjacent_find(times_.begin(), times_.end(), std::greater_equal<>()) == times_.end(),
          "the rows of a trace are in order of time");
    seen_until_ns_ = std::max(times_.back(), extent ? extent->seen_until_ns : times_.back());
    more_to_come_ = extent && extent->planned_end_ns > seen_until_ns_;
  }

  OverTime RunOverTime(const Node& formula) {
    const Evaluation evaluation = Evaluate(formula, false);
    OverTime result;
    std::vector<bool> rows(future_ + 1, false);
    result.reading = ReadingOf(formula);
    if (result.reading == OverTimeReading::kFromHere)
      rows.assign(rows.size(), true);
    else
      rows.front() = true;
    std::vector<std::optional<RowRobustness>> values(future_);
    Unfold(evaluation, rows, false, result, values);
    for (const auto& value : values)
      if (value) result.rows.push_back({value->time_ns, value->lower + 0.0, value->upper + 0.0});
    return result;
  }

  Result Run(const Node& formula) {
    const Evaluation evaluation = Evaluate(formula, false);
    const double lower = evaluation.bounds.lower.front(), upper = evaluation.bounds.upper.front();
    Check(lower <= upper, "a robustness is between its bounds");
    Result result;
    result.lower = lower + 0.0;  // no minus zero in a report
    result.upper = upper + 0.0;
    bool upper_side = false;
    if (Holds(lower)) {
      result.truth = Truth::kTrue;
      result.robustness = result.lower;
    } else if (!Holds(upper)) {
      result.truth = Truth::kFalse;
      result.robustness = result.upper;
      upper_side = true;
    } else {
      if (!std::isfinite(lower) && !std::isfinite(upper)) return result;
      upper_side = std::abs(upper) < std::abs(lower);
      result.robustness = upper_side ? result.upper : result.lower;
    }
    const Decider decider = Decide(evaluation, 0, upper_side);
    if (decider.row == future_) return result;
    result.time_ns = times_[decider.row];
    result.evidence = Evidence(*decider.leaf, decider.row);
    return result;
  }

 private:
  // `negated`: under an odd number of negations, where what must not help the formula is a comparison that
  // holds.
  Evaluation Evaluate(const Node& node, bool negated) {
    Evaluation result{node, {}, {}};
    if (IsComparison(node.op)) {
      result.bounds = Compare(node, negated);
      return result;
    }
    if (node.op == Op::kTrue) result.bounds = Constant(kInfinity);
    if (node.op == Op::kFalse) result.bounds = Constant(-kInfinity);
    if (node.op == Op::kFaultActive) result.bounds = FaultActive(node, negated);
    if (node.left) result.operands.push_back(Evaluate(*node.left, negated != FlipsLeft(node)));
    if (node.right) result.operands.push_back(Evaluate(*node.right, negated));
    for (const bool upper_side : {false, true}) {
      if (result.operands.empty()) break;
      (upper_side ? result.bounds.upper : result.bounds.lower) = Combine(result, upper_side);
    }
    return result;
  }

  // Adds what the evaluation asks of each of the rows to the rows' values.
  void Unfold(const Evaluation& at, const std::vector<bool>& rows, bool negated, OverTime& result,
              std::vector<std::optional<RowRobustness>>& values) const {
    const bool lowest = result.reading != OverTimeReading::kHighest;
    const bool whole = result.reading == OverTimeReading::kFromHere;
    const bool is_not = at.node.op == Op::kNot;
    if (!whole && (is_not || Folds(at.node, lowest, negated))) {
      const bool over_window = at.node.op == Op::kAlways || at.node.op == Op::kEventually;
      Unfold(at.operands[0], over_window ? RowsOfAny(at.node, rows) : rows, negated != FlipsLeft(at.node),
             result, values);
      if (at.node.right) Unfold(at.operands[1], rows, negated, result, values);
      return;
    }
    result.looks_ahead |= LooksAhead(at.node);
    for (std::size_t r = 0; r < future_; ++r) {
      if (!rows[r]) continue;
      double lower = at.bounds.lower[r], upper = at.bounds.upper[r];
      if (negated) lower = -std::exchange(upper, -lower);
      Check(lower <= upper, "a robustness is between its bounds");
      if (!values[r]) values[r] = {times_[r], lower, upper};
      const auto fold = [&](double a, double b) { return lowest ? Lowest()(a, b) : Highest()(a, b); };
      values[r] = {times_[r], fold(values[r]->lower, lower), fold(values[r]->upper, upper)};
    }
  }

  // All rows that a window looks at from any of the rows. Windows only move forward: no row is taken twice.
  std::vector<bool> RowsOfAny(const Node& node, const std::vector<bool>& rows) const {
    std::vector<bool> inside(rows.size(), false);
    std::size_t done = 0;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if (!rows[r]) continue;
      const Rows window = RowsOf(node, r);
      for (std::size_t i = std::max(window.first, done); i < window.last; ++i) inside[i] = true;
      done = std::max(done, window.last);
    }
    return inside;
  }

  Bounds Constant(double value) const {
    const std::vector<double> column(future_ + 1, value);
    return {column, column};
  }

  // One bound of an operator from the bounds of its operands.
  std::vector<double> Combine(const Evaluation& parent, bool upper_side) const {
    const Node& node = parent.node;
    Check(parent.operands.size() == (node.right ? 2U : 1U),
          "an operator was evaluated with all its operands");
    std::vector<double> left = Side(parent, 0, upper_side);
    switch (node.op) {
      case Op::kNot:
        return left;
      case Op::kAnd:
        return Each<Lowest>(std::move(left), parent.operands[1].bounds.Of(upper_side));
      case Op::kOr:
      case Op::kImplies:
        return Each<Highest>(std::move(left), parent.operands[1].bounds.Of(upper_side));
      case Op::kAlways:
        return Slide<Lowest>(node, left, kInfinity);
      case Op::kEventually:
        return Slide<Highest>(node, left, -kInfinity);
      case Op::kUntil:
        return SlideUntil(node, left, parent.operands[1].bounds.Of(upper_side));
      default:
        ThrowBrokenInvariant("an operator on formulas");
    }
  }

  // An operand's bound as its parent uses it: negation swaps the sides.
  std::vector<double> Side(const Evaluation& parent, std::size_t operand, bool upper_side) const {
    const bool negate = operand == 0 && (parent.node.op == Op::kNot || parent.node.op == Op::kImplies);
    std::vector<double> values = parent.operands[operand].bounds.Of(upper_side != negate);
    if (negate)
      for (double& value : values) value = -value;
    return values;
  }

  template <class Operation>
  static std::vector<double> Each(std::vector<double> left, const std::vector<double>& right) {
    Check(left.size() == right.size(), "both operands have a value for each row");
    for (std::size_t r = 0; r < left.size(); ++r) left[r] = Operation()(left[r], right[r]);
    return left;
  }

  template <class Operation>
  std::vector<double> Slide(const Node& node, const std::vector<double>& values, double neutral) const {
    SlidingFold<double, Operation> fold(values, neutral);
    std::vector<double> result(values.size());
    for (std::size_t r = 0; r < result.size(); ++r) {
      const Rows rows = RowsOf(node, r);
      result[r] = fold.Over(rows.first, rows.last);
    }
    return result;
  }

  std::vector<double> SlideUntil(const Node& node, const std::vector<double>& stay,
                                 const std::vector<double>& reach) const {
    Check(stay.size() == reach.size(), "both operands have a value for each row");
    std::vector<Until> steps(stay.size());
    for (std::size_t r = 0; r < steps.size(); ++r) steps[r] = {stay[r], reach[r]};
    SlidingFold<double, Lowest> before(stay, kInfinity);
    SlidingFold<Until, ThenUntil> within(steps, Until{});
    std::vector<double> result(stay.size());
    for (std::size_t r = 0; r < result.size(); ++r) {
      const Rows rows = RowsOf(node, r);
      const double worst_before = before.Over(r, StayEnd(node, r, rows));
      result[r] = Lowest()(worst_before, within.Over(rows.first, rows.last).reach);
    }
    return result;
  }

  // "stay" must hold on rows [r, StayEnd) wherever in the window "reach" does: up to the window's first row,
  // and on that one too when it begins before the window does.
  std::size_t StayEnd(const Node& node, std::size_t r, const Rows& rows) const {
    const TimeNs begin_ns = node.window->begin_ns;
    const bool begins_before =
        rows.first == future_ ? begin_ns > 0 : times_[rows.first] < times_[r] + begin_ns;
    return rows.first + (begins_before ? 1 : 0);
  }

  // First and last never decrease from row to row, as the sliding folds need.
  Rows RowsOf(const Node& node, std::size_t r) const {
    if (r == future_) return {future_, future_ + 1};
    if (!node.window) return {r, future_ + (more_to_come_ ? 1 : 0)};
    const TimeNs begin_ns = times_[r] + node.window->begin_ns, end_ns = times_[r] + node.window->end_ns;
    const auto index = [&](auto it) { return static_cast<std::size_t>(it - times_.begin()); };
    const std::size_t first = index(std::lower_bound(times_.begin(), times_.end(), begin_ns));
    const std::size_t last = index(std::upper_bound(times_.begin(), times_.end(), end_ns));
    if (end_ns > seen_until_ns_) return {first, future_ + 1};
    Check(0 < last && first <= last && last <= future_, "a window begins at or after the first row");
    if (first == last) return {last - 1, last};  // between two rows: the one before, which still holds
    return {first, last};
  }

  Bounds Compare(const Node& node, bool negated) {
    const Scale left_scale = ScaleOf(trace_, *node.left), right_scale = ScaleOf(trace_, *node.right);
    const bool has_signal = left_scale.has_signal || right_scale.has_signal;
    double scale = 1.0;
    if (has_signal)
      scale = std::max(left_scale.has_signal ? left_scale.value : 0.0,
                       right_scale.has_signal ? right_scale.value : 0.0);
    const bool less = node.op == Op::kLess || node.op == Op::kLessEqual;
    const double at_zero = node.op == Op::kLessEqual || node.op == Op::kGreaterEqual ? 0.0 : -0.0;
    const std::vector<double> left = Numbers(*node.left), right = Numbers(*node.right);
    Bounds bounds = Constant(0.0);
    for (std::size_t r = 0; r <= future_; ++r) {
      const double margin = less ? right[r] - left[r] : left[r] - right[r];
      double robustness = margin == 0.0 ? at_zero : margin / scale;
      if (std::isnan(margin)) robustness = negated ? kInfinity : -kInfinity;
      bounds.lower[r] = bounds.upper[r] = robustness;
    }
    if (has_signal) {
      bounds.lower[future_] = -kInfinity;
      bounds.upper[future_] = kInfinity;
    }
    return bounds;
  }

  Bounds FaultActive(const Node& node, bool negated) {
    const std::vector<double>& active = Signal(std::string(kActivePrefix) + node.name);
    Bounds bounds = Constant(kInfinity);
    for (std::size_t r = 0; r < future_; ++r) {
      const bool holds = std::isnan(active[r]) ? negated : active[r] != 0.0;
      bounds.lower[r] = bounds.upper[r] = holds ? kInfinity : -kInfinity;
    }
    bounds.lower[future_] = -kInfinity;
    return bounds;
  }

  // Values of an expression in each row; in the future only constants mean anything.
  std::vector<double> Numbers(const Node& node) {
    if (node.op == Op::kNumber) return std::vector<double>(future_ + 1, node.number);
    if (node.op == Op::kSignal) return Signal(node.name);
    std::vector<double> left = Numbers(*node.left);
    const std::vector<double> right = node.right ? Numbers(*node.right) : left;
    for (std::size_t r = 0; r < left.size(); ++r) left[r] = Apply(node.op, left[r], right[r]);
    return left;
  }

  const std::vector<double>& Signal(const std::string& name) {
    const auto it = signals_.find(name);
    if (it != signals_.end()) return it->second;
    std::vector<double> values = ReadSignal(trace_, name);
    Check(values.size() == future_, "a signal has a value for each row");
    values.push_back(std::numeric_limits<double>::quiet_NaN());
    return signals_.emplace(name, std::move(values)).first->second;
  }

  // Follows a value down to its source. If one operand decides by itself (a broken "always", a fulfilled
  // "eventually"), the earliest such operand counts; if all had to agree, the one that came nearest to not
  // agreeing.
  Decider Decide(const Evaluation& at, std::size_t row, bool upper_side) const {
    CheckIndex(row, at.bounds.Of(upper_side).size(), "a formula is decided in one of its rows");
    const bool holds = Holds(at.bounds.Of(upper_side)[row]);
    switch (at.node.op) {
      case Op::kNot:
        return Decide(at.operands[0], row, !upper_side);
      case Op::kAnd:
      case Op::kOr:
      case Op::kImplies:
        return DecideBinary(at, row, upper_side, holds);
      case Op::kAlways:
      case Op::kEventually: {
        const Rows rows = RowsOf(at.node, row);
        const auto& values = at.operands[0].bounds.Of(upper_side);
        return Decide(at.operands[0], Pick(values, rows, at.node.op == Op::kAlways, holds), upper_side);
      }
      case Op::kUntil:
        return DecideUntil(at, row, upper_side, holds);
      default:
        Check(at.operands.empty(), "a formula without operands");
        return {row, &at.node};
    }
  }

  Decider DecideBinary(const Evaluation& at, std::size_t row, bool upper_side, bool holds) const {
    const bool flips = at.node.op == Op::kImplies;
    const double sign = flips ? -1.0 : 1.0;
    const double left = sign * at.operands[0].bounds.Of(upper_side != flips)[row];
    const double right = at.operands[1].bounds.Of(upper_side)[row];
    const auto decide_left = [&] { return Decide(at.operands[0], row, upper_side != flips); };
    const auto decide_right = [&] { return Decide(at.operands[1], row, upper_side); };
    const bool is_and = at.node.op == Op::kAnd;
    if (is_and != holds && Holds(left) == holds && Holds(right) == holds) {  // either alone decides
      const Decider by_left = decide_left(), by_right = decide_right();
      return by_right.row < by_left.row ? by_right : by_left;
    }
    return (is_and ? Less(right, left) : Less(left, right)) ? decide_right() : decide_left();
  }

  Decider DecideUntil(const Evaluation& at, std::size_t row, bool upper_side, bool holds) const {
    const auto& stay = at.operands[0].bounds.Of(upper_side);
    const auto& reach = at.operands[1].bounds.Of(upper_side);
    const Rows rows = RowsOf(at.node, row);
    const std::size_t stay_end = std::max(StayEnd(at.node, row, rows), rows.last - 1);
    if (!holds)
      for (std::size_t r = row; r < stay_end; ++r)
        if (!Holds(stay[r])) return Decide(at.operands[0], r, upper_side);
    return Decide(at.operands[1], Pick(reach, rows, false, holds), upper_side);
  }

  // The earliest of the rows' values that decides by itself, otherwise the lowest or highest.
  static std::size_t Pick(const std::vector<double>& values, const Rows& rows, bool lowest, bool holds) {
    std::size_t best = rows.first;
    for (std::size_t r = rows.first; r < rows.last; ++r) {
      if (lowest != holds && Holds(values[r]) == holds) return r;
      if (lowest ? Less(values[r], values[best]) : Less(values[best], values[r])) best = r;
    }
    return best;
  }

  // The signals of a leaf with their values in a row.
  std::string Evidence(const Node& leaf, std::size_t row) const {
    std::string text;
    if (leaf.op == Op::kFaultActive) {
      const double active = signals_.at(std::string(kActivePrefix) + leaf.name)[row];
      return "fault_active(\"" + leaf.name + "\") is " +
             (std::isnan(active) ? "unknown"
              : active != 0.0    ? "true"
                                 : "false");
    }
    std::vector<std::string> names;
    CollectSignals(leaf, names);
    for (const std::string& name : names) {
      char value[32];
      std::snprintf(value, sizeof value, "%.6g", signals_.at(name)[row]);
      text += (text.empty() ? "" : ", ") + name + " = " + value;
    }
    return text;
  }

  static void CollectSignals(const Node& node, std::vector<std::string>& names) {
    if (node.op == Op::kSignal && std::find(names.begin(), names.end(), node.name) == names.end())
      names.push_back(node.name);
    if (node.left) CollectSignals(*node.left, names);
    if (node.right) CollectSignals(*node.right, names);
  }

  const Trace& trace_;
  std::vector<TimeNs> times_;
  std::size_t future_;         // index of the row behind the last
  TimeNs seen_until_ns_ = 0;   // windows that reach further reach into the future
  bool more_to_come_ = false;  // the flight was planned to go on after that
  std::map<std::string, std::vector<double>> signals_;
};

}  // namespace

Result Evaluate(const Formula& formula, const Trace& trace, std::optional<Extent> extent) {
  return Monitor(trace, extent).Run(*formula);
}

OverTime EvaluateOverTime(const Formula& formula, const Trace& trace, std::optional<Extent> extent) {
  return Monitor(trace, extent).RunOverTime(*formula);
}

}  // namespace tiltproof::harness::stl
