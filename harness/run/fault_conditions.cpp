#include "harness/run/fault_conditions.h"

#include <algorithm>

#include "harness/reference/trajectory.h"

namespace tiltproof::harness {

ReferencePath PlannedPath(const Scenario& scenario) {
  const Trajectory trajectory(scenario.reference);
  std::vector<Point> points;
  const auto add = [&](TimeNs t) { points.push_back(trajectory.At(t).position_m); };
  for (TimeNs t = 0; t < scenario.duration_ns; t += scenario.link.protocol->control_period_ns) add(t);
  add(scenario.duration_ns);
  return ReferencePath(points);
}

FaultConditions::FaultConditions(const Scenario& scenario, const std::vector<std::string>& columns) {
  const std::vector<std::string> signals = SignalNames(columns);
  for (std::size_t fault = 0; fault < scenario.faults.size(); ++fault)
    if (const std::string& text = scenario.faults[fault].when; !text.empty())
      conditions_.push_back({fault, stl::Condition(text, signals)});
  for (const Entry& entry : conditions_) {
    for (const std::string& name : entry.condition.Signals()) {
      const auto known = [&](const Signal& signal) { return signal.name == name; };
      if (std::any_of(signals_.begin(), signals_.end(), known)) continue;
      if (name == kCrossTrackError) path_.emplace(PlannedPath(scenario));
      signals_.push_back({name, RowSignal(columns, name, path_ ? &*path_ : nullptr), 0.0});
    }
  }
}

void FaultConditions::Look(TimeNs t, std::span<const double> row, std::vector<faults::FaultEvent>& events) {
  for (Signal& signal : signals_) signal.value = signal.reader.At(row);
  const auto value_of = [&](std::string_view name) {
    return std::find_if(signals_.begin(), signals_.end(),
                        [&](const Signal& signal) { return signal.name == name; })
        ->value;
  };
  for (Entry& entry : conditions_) {
    const bool holds = entry.condition.Holds(value_of);
    if (holds == entry.holds) continue;
    entry.holds = holds;
    using Kind = faults::FaultEvent::Kind;
    events.push_back({holds ? Kind::kConditionHolds : Kind::kConditionEnds, entry.fault, t});
  }
}

std::vector<std::string> FaultConditions::SignalNames(std::span<const std::string> columns) {
  std::vector<std::string> names = harness::SignalNames(columns);
  // Watched values come from the firmware, and enter the trace after the flight.
  std::erase_if(
      names, [](const std::string& name) { return name.ends_with("_count") || name.starts_with("watch_"); });
  return names;
}

}  // namespace tiltproof::harness
