#include "harness/score/stl_reading.h"

namespace tiltproof::harness::stl {
namespace {

bool IsOverWindow(const Node& node) { return node.op == Op::kAlways || node.op == Op::kEventually; }

// On every way down from here such operators lead to an always (for the lowest) or an eventually.
bool IsOf(const Node& node, bool lowest, bool negated) {
  if (node.op == Op::kNot) return IsOf(*node.left, lowest, !negated);
  if (!Folds(node, lowest, negated)) return false;
  return IsOverWindow(node) ||
         (IsOf(*node.left, lowest, negated != FlipsLeft(node)) && IsOf(*node.right, lowest, negated));
}

}  // namespace

std::string_view Name(OverTimeReading reading) {
  switch (reading) {
    case OverTimeReading::kLowest:
      return "lowest";
    case OverTimeReading::kHighest:
      return "highest";
    case OverTimeReading::kFromHere:
      return "from_here";
  }
  return "unknown";
}

OverTimeReading ReadingOf(const Node& formula) {
  if (IsOf(formula, true, false)) return OverTimeReading::kLowest;
  if (IsOf(formula, false, false)) return OverTimeReading::kHighest;
  return OverTimeReading::kFromHere;
}

bool Folds(const Node& node, bool lowest, bool negated) {
  switch (node.op) {
    case Op::kAnd:
    case Op::kAlways:
      return lowest != negated;
    case Op::kOr:
    case Op::kImplies:
    case Op::kEventually:
      return lowest == negated;
    default:
      return false;
  }
}

bool FlipsLeft(const Node& node) { return node.op == Op::kNot || node.op == Op::kImplies; }

bool LooksAhead(const Node& node) {
  if (IsOverWindow(node) || node.op == Op::kUntil) return true;
  return (node.left && LooksAhead(*node.left)) || (node.right && LooksAhead(*node.right));
}

}  // namespace tiltproof::harness::stl
