#include "harness/campaign/fault_level.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "faults/registry.h"
#include "faults/signal_choice.h"

namespace tiltproof::harness {
namespace {

using faults::FaultSpec;
using faults::FaultType;
using faults::ParameterInfo;
using faults::ParameterKind;

bool IsNumber(const ParameterInfo& info) {
  return info.kind == ParameterKind::kNumber || info.kind == ParameterKind::kInteger;
}

const ParameterInfo* FindNumber(const FaultType& type, std::string_view name) {
  for (const ParameterInfo& info : type.parameters)
    if (info.name == name && IsNumber(info)) return &info;
  return nullptr;
}

// Null: the length of the window measures it.
const ParameterInfo* ParameterOf(const FaultSpec& fault, const FaultType& type, const std::string& wanted) {
  if (wanted == kWindowParameter && type.end != faults::Bound::kRefused) return nullptr;
  if (!wanted.empty()) {
    if (const ParameterInfo* info = FindNumber(type, wanted)) return info;
    std::vector<std::string_view> names;
    for (const ParameterInfo& info : type.parameters)
      if (IsNumber(info)) names.push_back(info.name);
    if (type.end != faults::Bound::kRefused) names.push_back(kWindowParameter);
    throw SeverityMistake(fmt::format("{} of fault '{}' has no number '{}'{}{}", type.name, fault.id, wanted,
                                      names.empty() ? "" : "; it has: ", fmt::join(names, ", ")));
  }
  if (type.has_no_severity)
    throw SeverityMistake(fmt::format("{} has no severity: no number measures it", type.name));
  if (!type.has_severity())
    throw SeverityMistake(
        fmt::format("{} happens at one instant and has no parameter that measures its severity", type.name));
  return type.severity_parameter();
}

// The unit of the signal that the fault names, in place of "of the signal".
std::string UnitOf(const ParameterInfo& info, const FaultSpec& fault, const FaultType& type,
                   const VehicleSignals& signals) {
  const std::string unit(info.unit);
  if (!unit.starts_with("of the ")) return unit;
  std::string of_signal;
  for (const ParameterInfo& named : type.parameters) {
    const auto value = fault.parameters.find(std::string(named.name));
    if (!faults::NamesSignal(named.kind) || value == fault.parameters.end()) continue;
    const auto& name = std::get<std::string>(value->second);
    const bool is_input = named.kind == ParameterKind::kInput;
    const SignalTable& table = is_input ? signals.inputs : signals.sensors;
    for (const Signal& signal : table)
      if (signal.name == name || (is_input && signal.name.starts_with(name + "_"))) of_signal = signal.unit;
    break;
  }
  if (of_signal.empty()) return unit;
  const std::size_t more = unit.find(", 1/");
  return more == std::string::npos ? of_signal : of_signal + "/" + unit.substr(more + 4);
}

// The part of [min, max] to search, as a walk away from `harmless`.
LevelRange Walk(double min, double max, std::optional<double> harmless, std::optional<double> own,
                const SeverityChoice& choice) {
  double low = choice.low.value_or(min), high = choice.high.value_or(max);
  // The user names the mild end of a number that has no harmless value.
  const bool falls = !harmless && low > high;
  if (falls) std::swap(low, high);
  if (low < min || high > max) throw SeverityMistake(fmt::format("allowed is {:g} to {:g}", min, max));
  if (harmless && *harmless > min && *harmless < max) {
    const bool below = choice.high  ? *choice.high <= *harmless
                       : choice.low ? *choice.low < *harmless
                                    : own && *own < *harmless;
    if (below && !choice.high) high = *harmless;
    if (!below && !choice.low) low = *harmless;
    if (low < *harmless && high > *harmless)
      throw SeverityMistake(
          fmt::format("{:g} is harmless and lies between {:g} and {:g}: a search goes to one side of it",
                      *harmless, low, high));
  }
  if (!(low < high)) throw SeverityMistake(fmt::format("{:g} is not less than {:g}", low, high));
  const bool downwards = falls || (harmless && *harmless >= high);
  return {.start = downwards ? high : low, .end = downwards ? low : high, .harmless = harmless};
}

Severity WindowSeverity(const Scenario& scenario, const FaultSpec& fault, const SeverityChoice& choice) {
  if (fault.start_ns == kPowerOn || fault.start_ns >= scenario.duration_ns)
    throw SeverityMistake(fmt::format(
        "the severity of {} is the length of its window: fault '{}' needs a start_s before the flight's end",
        fault.type, fault.id));
  const double longest_s = ToSeconds(scenario.duration_ns - fault.start_ns);
  const double shortest_s = std::min(ToSeconds(scenario.step_ns), longest_s / 2);
  Severity severity{std::string(kWindowParameter), "s",
                    Walk(shortest_s, longest_s, 0.0, std::nullopt, choice)};
  severity.range.scale = faults::Scale::kLogarithmic;
  return severity;
}

Severity ParameterSeverity(const Scenario& scenario, const FaultSpec& fault, const FaultType& type,
                           const ParameterInfo& info, const VehicleSignals& signals,
                           const SeverityChoice& choice) {
  Severity severity;
  severity.parameter = info.name;
  severity.unit = UnitOf(info, fault, type, signals);
  const bool lengthens = info.name == type.duration_ms;
  // A flight cannot tell lengths apart that exceed it.
  const double max = lengthens && fault.start_ns != kPowerOn
                         ? std::min(info.max, 1e3 * ToSeconds(scenario.duration_ns - fault.start_ns))
                         : info.max;
  std::optional<double> harmless;
  if (info.severity && info.zero) harmless = std::get<double>(*info.zero);
  std::optional<double> own;
  if (const auto value = fault.parameters.find(severity.parameter); value != fault.parameters.end())
    own = std::get<double>(value->second);
  if (!info.severity && !lengthens && !(choice.low && choice.high))
    throw SeverityMistake(
        fmt::format("'{}' does not measure the severity of {}: give both --low (mild) and --high (severe)",
                    info.name, type.name));
  severity.range = Walk(info.min, max, harmless, own, choice);
  // An end that the user chose is meant; the type's may be the largest number allowed.
  const bool chosen_end =
      severity.range.end < severity.range.start ? choice.low.has_value() : choice.high.has_value();
  if (info.severity && !chosen_end) severity.range.typical = std::get<double>(info.example);
  severity.range.whole = info.kind == ParameterKind::kInteger;
  severity.range.scale =
      info.severity.value_or(lengthens ? faults::Scale::kLogarithmic : faults::Scale::kLinear);
  if (severity.range.start * severity.range.end < 0) severity.range.scale = faults::Scale::kLinear;
  return severity;
}

}  // namespace

Severity SeverityOf(const Scenario& scenario, std::size_t fault, const VehicleSignals& signals,
                    const SeverityChoice& choice) {
  const FaultSpec& spec = scenario.faults.at(fault);
  const FaultType& type = *faults::FindFaultType(spec.type);
  const ParameterInfo* info = ParameterOf(spec, type, choice.parameter);
  return info == nullptr ? WindowSeverity(scenario, spec, choice)
                         : ParameterSeverity(scenario, spec, type, *info, signals, choice);
}

Scenario AtLevel(const Scenario& scenario, std::size_t fault, const Severity& severity, double level) {
  Scenario changed = scenario;
  FaultSpec& spec = changed.faults.at(fault);
  if (severity.parameter == kWindowParameter)
    spec.end_ns = spec.start_ns + FromSeconds(level);
  else
    spec.parameters[severity.parameter] = level;
  return changed;
}

}  // namespace tiltproof::harness
