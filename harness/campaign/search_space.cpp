#include "harness/campaign/search_space.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "faults/registry.h"
#include "harness/campaign/fault_level.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr double kDecades = 1000;
// So many whole numbers are hardly different from all numbers.
constexpr double kWhole_count_max = 1000;

double Rounded(double value) { return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr); }

std::optional<double> OwnSeverity(const faults::FaultSpec& fault, const Severity& severity) {
  if (severity.parameter == kWindowParameter) return std::nullopt;  // a number of its own, below
  const faults::Parameters parameters = faults::ResolvedParameters(fault, *faults::FindFaultType(fault.type));
  return parameters.Has(severity.parameter) ? std::optional(parameters.Number(severity.parameter))
                                            : std::nullopt;
}

// From harmless to the scenario's own; none where the scenario's own is harmless.
std::optional<SearchedNumber> SeverityNumber(const Scenario& scenario, std::size_t place,
                                             const VehicleSignals& signals) {
  const faults::FaultSpec& fault = scenario.faults[place];
  Severity severity;
  try {
    severity = SeverityOf(scenario, place, signals);
  } catch (const SeverityMistake&) {
    return std::nullopt;
  }
  const std::optional<double> own = OwnSeverity(fault, severity);
  if (!own) return std::nullopt;
  double mild = severity.range.harmless.value_or(severity.range.start);
  if (*own == mild) return std::nullopt;
  SearchedNumber number{.name = fmt::format("faults.{}.parameters.{}", fault.id, severity.parameter),
                        .unit = severity.unit,
                        .whole = severity.range.whole,
                        .own = own,
                        .set = [place, severity](Scenario& changed, double level) {
                          changed = AtLevel(changed, place, severity, level);
                        }};
  number.logarithmic =
      severity.range.scale == faults::Scale::kLogarithmic && mild * *own >= 0 && *own != 0 && !number.whole;
  if (number.logarithmic) {
    const double far = mild == 0 ? 0 : mild / *own;
    if (far < 1 / kDecades || far > kDecades) mild = far > 1 ? *own * kDecades : *own / kDecades;
  }
  number.low = std::min(mild, *own);
  number.high = std::max(mild, *own);
  return number;
}

void AddWindow(const Scenario& scenario, std::size_t place, std::vector<SearchedNumber>& numbers) {
  const faults::FaultSpec& fault = scenario.faults[place];
  const faults::FaultType& type = *faults::FindFaultType(fault.type);
  const bool is_whole_flight = fault.start_ns == kPowerOn && fault.end_ns == kNever;
  if (type.start == faults::Bound::kRefused || is_whole_flight || faults::WaitsForEvent(fault)) return;
  const TimeNs start_ns = std::max<TimeNs>(fault.start_ns, 0);
  const bool ends = fault.end_ns != kNever;
  const TimeNs length_ns = std::min(fault.end_ns, scenario.duration_ns) - start_ns;
  if (start_ns >= scenario.duration_ns || length_ns <= scenario.step_ns) return;
  numbers.push_back({.name = fmt::format("faults.{}.start_s", fault.id),
                     .unit = "s",
                     .low = 0,
                     .high = ToSeconds(scenario.duration_ns - scenario.step_ns),
                     .own = ToSeconds(start_ns),
                     .set = [place, ends, length_ns](Scenario& changed, double start_s) {
                       faults::FaultSpec& moved = changed.faults.at(place);
                       moved.start_ns = FromSeconds(start_s);
                       if (ends) moved.end_ns = moved.start_ns + length_ns;
                     }});
  if (!ends) return;
  numbers.push_back({.name = fmt::format("faults.{}.{}", fault.id, kWindowParameter),
                     .unit = "s",
                     .low = ToSeconds(scenario.step_ns),
                     .high = ToSeconds(length_ns),
                     .own = ToSeconds(length_ns),
                     .set = [place](Scenario& changed, double length_s) {
                       faults::FaultSpec& longer = changed.faults.at(place);
                       longer.end_ns = longer.start_ns + FromSeconds(length_s);
                     }});
}

// Values of a number that is searched by place; 0: every number between low and high.
int CountOf(const SearchedNumber& number) {
  if (!number.names.empty()) return static_cast<int>(number.names.size());
  const double count = std::floor(number.high) - std::ceil(number.low) + 1;
  return number.whole && !number.logarithmic && count <= kWhole_count_max ? static_cast<int>(count) : 0;
}

}  // namespace

std::vector<SearchedNumber> FaultNumbers(const Scenario& scenario, const VehicleSignals& signals) {
  std::vector<SearchedNumber> numbers;
  for (std::size_t place = 0; place < scenario.faults.size(); ++place) {
    if (auto severity = SeverityNumber(scenario, place, signals)) numbers.push_back(std::move(*severity));
    AddWindow(scenario, place, numbers);
  }
  return numbers;
}

std::vector<SearchAxis> AxesOf(const std::vector<SearchedNumber>& numbers) {
  std::vector<SearchAxis> axes;
  for (const SearchedNumber& number : numbers)
    axes.push_back({.values_count = CountOf(number), .ordered = number.names.empty()});
  return axes;
}

std::optional<SearchPoint> PointOf(const std::vector<SearchedNumber>& numbers) {
  SearchPoint point;
  for (const SearchedNumber& number : numbers) {
    if (!number.own) return std::nullopt;
    const double own = *number.own;
    const bool is_inside = number.names.empty() ? own >= number.low && own <= number.high
                                                : own >= 0 && own < static_cast<double>(number.names.size());
    if (!is_inside) return std::nullopt;
    if (!number.names.empty())
      point.push_back(own);
    else if (CountOf(number) > 0)
      point.push_back(own - std::ceil(number.low));
    else if (number.logarithmic)
      point.push_back(std::log(own / number.low) / std::log(number.high / number.low));
    else
      point.push_back((own - number.low) / (number.high - number.low));
  }
  return point;
}

double ValueAt(const SearchedNumber& number, double place) {
  if (!number.names.empty()) return place;
  if (CountOf(number) > 0) return std::ceil(number.low) + place;
  // The ends are exact.
  if (place <= 0) return number.low;
  if (place >= 1) return number.high;
  const double value = number.logarithmic ? number.low * std::exp(place * std::log(number.high / number.low))
                                          : number.low + place * (number.high - number.low);
  return std::clamp(number.whole ? std::round(value) : Rounded(value), number.low, number.high);
}

std::string TextAt(const SearchedNumber& number, double place) {
  if (!number.names.empty()) return number.names.at(static_cast<std::size_t>(place));
  return fmt::format("{}", ValueAt(number, place));
}

Scenario AtPoint(const Scenario& scenario, const std::vector<SearchedNumber>& numbers,
                 const SearchPoint& point) {
  Check(point.size() == numbers.size(), "a point has a place for each number");
  Scenario changed = scenario;
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i].set(changed, ValueAt(numbers[i], point[i]));
  return changed;
}

}  // namespace tiltproof::harness
