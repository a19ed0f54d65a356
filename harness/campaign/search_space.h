// The numbers of a scenario that a search varies, and the scenario at a point of them.
//
//   const std::vector<SearchedNumber> numbers = FaultNumbers(scenario, signals);
//   RobustnessSearch search(AxesOf(numbers), stream, PointOf(numbers));
//   for (const SearchPoint& point : search.Ask()) FlyAlone(AtPoint(scenario, numbers, point));
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/robustness_search.h"
#include "harness/scenario/scenario.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

struct SearchedNumber {
  std::string name;  // as of --over: faults.late.start_s
  std::string unit;  // empty: none
  double low = 0, high = 1;
  bool logarithmic = false;  // low and high have the same sign, and neither is 0
  bool whole = false;
  std::vector<std::string> names = {};  // in place of numbers: the value is a place in this list
  std::optional<double> own = {};       // what the scenario has; none: not known
  // Puts a value into the scenario. May throw std::exception: a scenario with it cannot be flown.
  std::function<void(Scenario&, double)> set;
};

// The severities of the scenario's faults, from harmless to what the scenario says, and the windows of those that
// have one: when it begins, within the flight, and its length, up to what the scenario says. The window of a fault
// that waits for an event stays. Logarithmic severities span three decades at most.
std::vector<SearchedNumber> FaultNumbers(const Scenario& scenario, const VehicleSignals& signals);

std::vector<SearchAxis> AxesOf(const std::vector<SearchedNumber>& numbers);
// The point of the scenario itself; none when a number is not known or lies outside its range.
std::optional<SearchPoint> PointOf(const std::vector<SearchedNumber>& numbers);

// The value of a number at its place in a point: between low and high, rounded to six digits.
double ValueAt(const SearchedNumber& number, double place);
// The same as text: a number, or a name.
std::string TextAt(const SearchedNumber& number, double place);
// The scenario with all values of the point, in the order of the numbers.
Scenario AtPoint(const Scenario& scenario, const std::vector<SearchedNumber>& numbers,
                 const SearchPoint& point);

}  // namespace tiltproof::harness
