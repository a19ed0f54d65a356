#include "harness/formula/formula.h"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "link/check.h"

namespace tiltproof::harness::stl {
namespace {

// Appends the canonical text of a formula to `out`.
class Printer {
 public:
  explicit Printer(std::string& out) : out_(out) {}

  void Print(const Node& node) {
    switch (node.op) {
      case Op::kNumber:
        return Number(node.number);
      case Op::kSignal:
        out_ += node.name;
        return;
      case Op::kNegate:
        out_ += '-';
        return Print(*node.left);
      case Op::kAbs:
        return Call("abs", node);
      case Op::kMin:
        return Call("min", node);
      case Op::kMax:
        return Call("max", node);
      case Op::kAdd:
        return Infix(" + ", node);
      case Op::kSubtract:
        return Infix(" - ", node);
      case Op::kMultiply:
        return Infix(" * ", node);
      case Op::kDivide:
        return Infix(" / ", node);
      // Both sides are numbers, which the grammar cannot bind wrongly: no parentheses.
      case Op::kLessEqual:
        return Operands(" <= ", node);
      case Op::kLess:
        return Operands(" < ", node);
      case Op::kGreaterEqual:
        return Operands(" >= ", node);
      case Op::kGreater:
        return Operands(" > ", node);
      case Op::kTrue:
        out_ += "true";
        return;
      case Op::kFalse:
        out_ += "false";
        return;
      case Op::kFaultActive:
        out_ += "fault_active(\"" + node.name + "\")";
        return;
      case Op::kNot:
        out_ += "not ";
        return Bracketed(*node.left);
      case Op::kAnd:
        return Infix(" and ", node);
      case Op::kOr:
        return Infix(" or ", node);
      case Op::kImplies:
        return Infix(" implies ", node);
      case Op::kAlways:
        return Temporal("always", node);
      case Op::kEventually:
        return Temporal("eventually", node);
      case Op::kUntil:
        out_ += '(';
        Bracketed(*node.left);
        out_ += " until";
        Range(*node.window);
        out_ += ' ';
        Bracketed(*node.right);
        out_ += ')';
        return;
    }
  }

 private:
  // Shortest text that reads back as the same number.
  void Number(double value) {
    std::array<char, 32> text{};
    const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
    out_.append(text.data(), result.ptr);
  }

  // Divided, not multiplied by 1e-9, which is no binary64 number: 60 s must not become 60.00000000000001.
  void Seconds(TimeNs time_ns) { Number(static_cast<double>(time_ns) / 1e9); }

  void Operands(const char* sign, const Node& node) {
    Print(*node.left);
    out_ += sign;
    Print(*node.right);
  }

  void Infix(const char* sign, const Node& node) {
    out_ += '(';
    Operands(sign, node);
    out_ += ')';
  }

  void Call(const char* name, const Node& node) {
    out_ += name;
    out_ += '(';
    Print(*node.left);
    if (node.right) {
      out_ += ", ";
      Print(*node.right);
    }
    out_ += ')';
  }

  void Bracketed(const Node& node) {
    out_ += '(';
    Print(node);
    out_ += ')';
  }

  void Range(const Window& window) {
    out_ += '[';
    Seconds(window.begin_ns);
    out_ += ',';
    Seconds(window.end_ns);
    out_ += ']';
  }

  void Temporal(const char* name, const Node& node) {
    out_ += name;
    if (node.window) Range(*node.window);
    Bracketed(*node.left);
  }

  std::string& out_;
};

bool HasTimeOperators(const Node& node) {
  if (node.op == Op::kAlways || node.op == Op::kEventually || node.op == Op::kUntil) return true;
  return (node.left && HasTimeOperators(*node.left)) || (node.right && HasTimeOperators(*node.right));
}

}  // namespace

std::string ToString(const Formula& formula) {
  std::string text;
  Printer(text).Print(*formula);
  return text;
}

Formula BodyOfAlways(const Formula& formula) {
  return formula->op == Op::kAlways && !HasTimeOperators(*formula->left) ? formula->left : nullptr;
}

double Apply(Op op, double left, double right) {
  switch (op) {
    case Op::kNegate:
      return -left;
    case Op::kAbs:
      return std::abs(left);
    // Not std::min and std::max: a NaN on either side must come out.
    case Op::kMin:
      return std::isnan(left) || left < right ? left : right;
    case Op::kMax:
      return std::isnan(left) || left > right ? left : right;
    case Op::kAdd:
      return left + right;
    case Op::kSubtract:
      return left - right;
    case Op::kMultiply:
      return left * right;
    case Op::kDivide:
      return left / right;
    default:
      ThrowBrokenInvariant("an operator on numbers");
  }
}

bool IsComparison(Op op) {
  return op == Op::kLessEqual || op == Op::kLess || op == Op::kGreaterEqual || op == Op::kGreater;
}

}  // namespace tiltproof::harness::stl
