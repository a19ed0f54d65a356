// Severity of a fault: the number that measures it, that number's range, and the scenario in which the fault
// has a given level.
//
//   const Severity severity = SeverityOf(scenario, 0, signals);     // sensor.drift of z_m: rate_per_s, in m/s
//   const Scenario harder = AtLevel(scenario, 0, severity, 0.05);  // drifts by 50 mm/s
#pragma once

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "harness/campaign/margin_search.h"
#include "harness/scenario/scenario.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// The name of a window's length among the parameters.
inline constexpr std::string_view kWindowParameter = "window_s";

struct Severity {
  std::string parameter;  // or kWindowParameter
  std::string unit;       // of the signal, where the parameter is in the unit of one
  LevelRange range;
};

// Part of the range, and another parameter, as a user asks for them.
struct SeverityChoice {
  std::string parameter = {};                 // empty: the type's severity
  std::optional<double> low = {}, high = {};  // numerically
};

// A fault without a severity, or a choice that it cannot have. what() says why.
struct SeverityMistake : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// From the value that is harmless to the end of the parameter's range. Where values on both sides are harmful,
// to the end on the side of the scenario's own value, or of the choice. Throws SeverityMistake.
Severity SeverityOf(const Scenario& scenario, std::size_t fault, const VehicleSignals& signals,
                    const SeverityChoice& choice = {});

// The scenario with its fault at this level.
Scenario AtLevel(const Scenario& scenario, std::size_t fault, const Severity& severity, double level);

}  // namespace tiltproof::harness
