// The tilt-rotor's signals without loading it, and a trace of it, for tests that are written for this vehicle.
#pragma once

#include <string>
#include <vector>

#include "firmware/signals.h"
#include "harness/formula/formula.h"
#include "harness/run/row_signals.h"
#include "harness/run/trace.h"

namespace tiltproof::testing {

inline VehicleSignals TiltrotorSignals() {
  std::vector<Signal> states, inputs;
  for (const auto& field : kSensorFields)
    states.push_back(SignalNamed(std::string(field.column), SignalFrame::kWorld));
  for (const auto& field : kActuatorFields)
    inputs.push_back(SignalNamed(std::string(field.column), SignalFrame::kRotor));
  return {.states = SignalTable(states), .sensors = SignalTable(states), .inputs = SignalTable(inputs)};
}

inline harness::Trace TiltrotorTrace(const harness::Scenario& scenario = {}) {
  return harness::Trace(harness::TraceLayout(TiltrotorSignals(), scenario).columns);
}

// A criterion's formula for this vehicle. Throws harness::stl::ParseError.
inline harness::stl::Formula ParseCriterion(std::string_view text, std::span<const std::string> fault_ids) {
  const std::vector<std::string> signals = harness::SignalNames(TiltrotorTrace().columns());
  return harness::stl::Parse(text, {.signals = signals, .fault_ids = fault_ids});
}

}  // namespace tiltproof::testing
