#include "harness/formula/condition.h"

#include <algorithm>

#include "link/check.h"

namespace tiltproof::harness::stl {
namespace {

double Value(const Node& node, const Condition::ValueOf& value_of) {
  if (node.op == Op::kNumber) return node.number;
  if (node.op == Op::kSignal) return value_of(node.name);
  Check(node.left != nullptr, "an operator on numbers has an operand");
  return Apply(node.op, Value(*node.left, value_of), node.right ? Value(*node.right, value_of) : 0.0);
}

bool Compare(Op op, double left, double right) {
  switch (op) {
    case Op::kLessEqual:
      return left <= right;
    case Op::kLess:
      return left < right;
    case Op::kGreaterEqual:
      return left >= right;
    case Op::kGreater:
      return left > right;
    default:
      ThrowBrokenInvariant("a comparison");
  }
}

bool Truth(const Node& node, const Condition::ValueOf& value_of) {
  Check(node.op == Op::kTrue || node.op == Op::kFalse || node.left != nullptr,
        "an operator on formulas has an operand");
  if (IsComparison(node.op))
    return Compare(node.op, Value(*node.left, value_of), Value(*node.right, value_of));
  switch (node.op) {
    case Op::kNot:
      return !Truth(*node.left, value_of);
    case Op::kAnd:
      return Truth(*node.left, value_of) && Truth(*node.right, value_of);
    case Op::kOr:
      return Truth(*node.left, value_of) || Truth(*node.right, value_of);
    case Op::kImplies:
      return !Truth(*node.left, value_of) || Truth(*node.right, value_of);
    case Op::kTrue:
    case Op::kFalse:
      return node.op == Op::kTrue;
    default:
      ThrowBrokenInvariant("a formula on one row");
  }
}

void Collect(const Node& node, std::vector<std::string>& signals) {
  if (node.op == Op::kSignal && std::find(signals.begin(), signals.end(), node.name) == signals.end())
    signals.push_back(node.name);
  for (const Formula& operand : {node.left, node.right})
    if (operand) Collect(*operand, signals);
}

}  // namespace

std::vector<std::string> Condition::Signals() const {
  std::vector<std::string> signals;
  Collect(*formula_, signals);
  return signals;
}

bool Condition::Holds(const ValueOf& value_of) const { return Truth(*formula_, value_of); }

}  // namespace tiltproof::harness::stl
