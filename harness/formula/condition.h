// A formula without time operators, true or false in one row: comparisons with and, or, not, implies.
//
//   const Condition low("z_m < 2 and speed_m_s > 1", SignalNames(columns));
//   if (low.Holds([&](std::string_view signal) { return ValueOf(signal); })) ...
//
// A comparison with NaN is false.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/formula/formula.h"

namespace tiltproof::harness::stl {

class Condition {
 public:
  using ValueOf = std::function<double(std::string_view signal)>;

  // Throws ParseError.
  Condition(std::string_view text, std::span<const std::string> signals)
      : formula_(Parse(text, {.signals = signals, .of_one_row = true})) {}

  // The signals that the condition names, each once.
  std::vector<std::string> Signals() const;
  bool Holds(const ValueOf& value_of) const;

 private:
  Formula formula_;
};

}  // namespace tiltproof::harness::stl
