#include "tests/harness/score/stl_oracle.h"

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

namespace tiltproof::testing {
namespace {

using harness::stl::Node;
using harness::stl::Op;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool Below(const SlowValue& a, const SlowValue& b) {
  if (a.number != b.number) return a.number < b.number;
  return !a.holds && b.holds;
}
SlowValue Minimum(const SlowValue& a, const SlowValue& b) { return Below(b, a) ? b : a; }
SlowValue Maximum(const SlowValue& a, const SlowValue& b) { return Below(a, b) ? b : a; }
SlowBounds Minimum(const SlowBounds& a, const SlowBounds& b) {
  return {Minimum(a.lower, b.lower), Minimum(a.upper, b.upper)};
}
SlowBounds Maximum(const SlowBounds& a, const SlowBounds& b) {
  return {Maximum(a.lower, b.lower), Maximum(a.upper, b.upper)};
}
SlowBounds Negated(const SlowBounds& a) {
  return {{-a.upper.number, !a.upper.holds}, {-a.lower.number, !a.lower.holds}};
}
SlowBounds Certain(bool holds) {
  const SlowValue value{holds ? kInfinity : -kInfinity, holds};
  return {value, value};
}
SlowBounds Anything() { return {{-kInfinity, false}, {kInfinity, true}}; }

// A formula without its negations: each stands at a comparison, or at what is asked of a row as a whole.
struct Plain {
  char kind;  // '&' lowest of the parts, '|' highest, 'r' of a row
  bool over_window = false;
  std::vector<Plain> parts{};
  const Node* node = nullptr;
  bool negated = false;
};

Plain WithoutNegations(const Node& node, bool negated) {
  const auto both = [&](char kind, bool flip_left) {
    return Plain{kind,
                 false,
                 {WithoutNegations(*node.left, negated != flip_left), WithoutNegations(*node.right, negated)},
                 &node,
                 negated};
  };
  const auto window = [&](char kind) {
    return Plain{kind, true, {WithoutNegations(*node.left, negated)}, &node, negated};
  };
  switch (node.op) {
    case Op::kNot:
      return WithoutNegations(*node.left, !negated);
    case Op::kAnd:
      return both(negated ? '|' : '&', false);
    case Op::kOr:
      return both(negated ? '&' : '|', false);
    case Op::kImplies:
      return both(negated ? '&' : '|', true);
    case Op::kAlways:
      return window(negated ? '|' : '&');
    case Op::kEventually:
      return window(negated ? '&' : '|');
    default:
      return {'r', false, {}, &node, negated};
  }
}

// On each way down from the top there is a window of this kind before anything else.
bool EveryPathHasAWindow(const Plain& plain, char kind) {
  if (plain.kind != kind) return false;
  if (plain.over_window) return true;
  return EveryPathHasAWindow(plain.parts[0], kind) && EveryPathHasAWindow(plain.parts[1], kind);
}

class Oracle {
 public:
  explicit Oracle(const SlowTrace& trace) : trace_(trace), rows_(trace.times_ns.size()) {}

  // At a row, or at "later than all rows" when row == rows_.
  SlowBounds At(const Node& node, std::size_t row, bool negated) const {
    switch (node.op) {
      case Op::kTrue:
        return Certain(true);
      case Op::kFalse:
        return Certain(false);
      case Op::kFaultActive: {
        if (row == rows_) return Anything();
        const double active = trace_.active_a[row];
        return std::isnan(active) ? Certain(negated) : Certain(active != 0.0);
      }
      case Op::kNot:
        return Negated(At(*node.left, row, !negated));
      case Op::kAnd:
        return Minimum(At(*node.left, row, negated), At(*node.right, row, negated));
      case Op::kOr:
        return Maximum(At(*node.left, row, negated), At(*node.right, row, negated));
      case Op::kImplies:
        return Maximum(Negated(At(*node.left, row, !negated)), At(*node.right, row, negated));
      case Op::kAlways:
      case Op::kEventually: {
        std::optional<SlowBounds> best;
        for (const std::size_t r : Window(node, row)) {
          const SlowBounds inside = At(*node.left, r, negated);
          if (!best)
            best = inside;
          else
            best = node.op == Op::kAlways ? Minimum(*best, inside) : Maximum(*best, inside);
        }
        return best.value();
      }
      case Op::kUntil: {
        std::optional<SlowBounds> best;
        for (const std::size_t reach : Window(node, row)) {
          SlowBounds value = At(*node.right, reach, negated);
          for (std::size_t r = row; r < rows_ + 1; ++r)
            if (StaysBefore(node, row, r, reach)) value = Minimum(value, At(*node.left, r, negated));
          best = best ? Maximum(*best, value) : value;
        }
        return best.value();
      }
      default:
        return Compare(node, row, negated);
    }
  }

  // Everything that counts at some row for the whole to have its value, in the order in which it is found.
  void Collect(const Plain& plain, char kind, std::size_t row,
               std::vector<std::vector<SlowBounds>>& found) const {
    if (plain.kind != kind) {
      SlowBounds value = At(*plain.node, row, plain.negated);
      found[row].push_back(plain.negated ? Negated(value) : value);
      return;
    }
    if (!plain.over_window)
      for (const Plain& part : plain.parts) Collect(part, kind, row, found);
    else
      for (const std::size_t r : Window(*plain.node, row)) Collect(plain.parts[0], kind, r, found);
  }

 private:
  // "left" must hold in row r when "right" is to do so in row `reach`, seen from `row`. In time, that is in
  // [t, t'), where t' is the time of `reach`, or the begin of the window if `reach` is the row before it.
  bool StaysBefore(const Node& node, std::size_t row, std::size_t r, std::size_t reach) const {
    if (r < reach) return true;
    if (r > reach) return false;
    const TimeNs begin_ns = node.window->begin_ns;
    if (row == rows_) return begin_ns > 0;
    // No row in the window: more of the unseen may lie before it.
    if (reach == rows_) return trace_.times_ns[row] + begin_ns > trace_.times_ns.back();
    return trace_.times_ns[reach] < trace_.times_ns[row] + begin_ns;
  }

  std::vector<std::size_t> Window(const Node& node, std::size_t row) const {
    if (row == rows_) return {rows_};
    const TimeNs now_ns = trace_.times_ns[row];
    std::vector<std::size_t> inside;
    if (!node.window) {
      for (std::size_t r = row; r < rows_; ++r) inside.push_back(r);
      if (trace_.planned_end_ns > trace_.seen_until_ns) inside.push_back(rows_);
      return inside;
    }
    const TimeNs begin_ns = now_ns + node.window->begin_ns, end_ns = now_ns + node.window->end_ns;
    for (std::size_t r = 0; r < rows_; ++r)
      if (begin_ns <= trace_.times_ns[r] && trace_.times_ns[r] <= end_ns) inside.push_back(r);
    if (end_ns > trace_.seen_until_ns) inside.push_back(rows_);
    if (!inside.empty()) return inside;
    std::size_t before = 0;
    for (std::size_t r = 0; r < rows_; ++r)
      if (trace_.times_ns[r] <= begin_ns) before = r;
    return {before};
  }

  SlowBounds Compare(const Node& node, std::size_t row, bool negated) const {
    const double scale = std::max(Scale(*node.left), Scale(*node.right));
    if (row == rows_ && scale > 0.0) return Anything();
    const double left = Number(*node.left, row), right = Number(*node.right, row);
    if (std::isnan(left) || std::isnan(right)) return Certain(negated);
    const double divisor = scale > 0.0 ? scale : 1.0;
    SlowValue value;
    switch (node.op) {
      case Op::kLessEqual:
        value = {(right - left) / divisor, left <= right};
        break;
      case Op::kLess:
        value = {(right - left) / divisor, left < right};
        break;
      case Op::kGreaterEqual:
        value = {(left - right) / divisor, left >= right};
        break;
      case Op::kGreater:
        value = {(left - right) / divisor, left > right};
        break;
      default:
        throw std::logic_error("not a comparison");
    }
    return {value, value};
  }

  // The table of scales, for sums and the like of the two signals; 0 without one.
  double Scale(const Node& node) const {
    if (node.op == Op::kSignal) return node.name == "roll_rad" ? 0.5 : 1.0;
    double scale = 0.0;
    if (node.left) scale = std::max(scale, Scale(*node.left));
    if (node.right) scale = std::max(scale, Scale(*node.right));
    return scale;
  }

  double Number(const Node& node, std::size_t row) const {
    switch (node.op) {
      case Op::kNumber:
        return node.number;
      case Op::kSignal:
        return node.name == "x_m" ? trace_.x_m[row] : trace_.roll_rad[row];
      case Op::kNegate:
        return -Number(*node.left, row);
      case Op::kAbs:
        return std::abs(Number(*node.left, row));
      case Op::kAdd:
        return Number(*node.left, row) + Number(*node.right, row);
      case Op::kSubtract:
        return Number(*node.left, row) - Number(*node.right, row);
      case Op::kMin:
      case Op::kMax: {
        const double a = Number(*node.left, row), b = Number(*node.right, row);
        if (std::isnan(a) || std::isnan(b)) return a + b;
        return node.op == Op::kMin ? std::min(a, b) : std::max(a, b);
      }
      default:
        throw std::logic_error("not a number of this oracle");
    }
  }

  const SlowTrace& trace_;
  std::size_t rows_;
};

}  // namespace

harness::Trace SlowTrace::ToTrace() const {
  harness::Trace trace({"t_s", "x_m", "roll_rad", "active_a"});
  for (std::size_t r = 0; r < times_ns.size(); ++r) {
    const auto row = trace.AppendRow();
    row[0] = ToSeconds(times_ns[r]);
    row[1] = x_m[r];
    row[2] = roll_rad[r];
    row[3] = active_a[r];
  }
  return trace;
}

SlowBounds SlowEvaluate(const harness::stl::Formula& formula, const SlowTrace& trace) {
  return Oracle(trace).At(*formula, 0, false);
}

SlowOverTime SlowEvaluateOverTime(const harness::stl::Formula& formula, const SlowTrace& trace) {
  using harness::stl::OverTimeReading;
  const Oracle oracle(trace);
  const Plain plain = WithoutNegations(*formula, false);
  SlowOverTime result;
  for (const char kind : {'&', '|'}) {
    if (!EveryPathHasAWindow(plain, kind)) continue;
    result.reading = kind == '&' ? OverTimeReading::kLowest : OverTimeReading::kHighest;
    std::vector<std::vector<SlowBounds>> found(trace.times_ns.size() + 1);
    oracle.Collect(plain, kind, 0, found);
    for (std::size_t r = 0; r < trace.times_ns.size(); ++r) {
      std::optional<SlowBounds> value;
      for (const SlowBounds& v : found[r])
        value = !value ? v : kind == '&' ? Minimum(*value, v) : Maximum(*value, v);
      result.rows.push_back(value);
    }
    return result;
  }
  result.reading = OverTimeReading::kFromHere;
  for (std::size_t r = 0; r < trace.times_ns.size(); ++r)
    result.rows.emplace_back(oracle.At(*formula, r, false));
  return result;
}

}  // namespace tiltproof::testing
