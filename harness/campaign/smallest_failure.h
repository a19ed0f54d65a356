// The smallest scenario that still fails by the same criterion: fewer faults, a simpler path, shorter
// windows, milder faults, a shorter flight. Pure: it flies nothing, but asks `evaluate`.
//
//   const Evaluate evaluate = [&](const Scenario& scenario) -> std::optional<Flown> { return Fly(scenario); };
//   const SmallestFailure smallest = MinimiseFailure(scenario, signals, evaluate, {.runs_max = 200});
//   if (smallest.fails() && smallest.confirmed) Write(WriteResolved(smallest.scenario));
//
// Only what was flown and failed replaces what was there. The search assumes that more of a fault is worse; where that is
// wrong, the result still fails, but a smaller one may exist.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/engine/flight_result.h"
#include "harness/scenario/scenario.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// A flight, as far as the search needs to know it.
struct Flown {
  std::string criterion;                  // the first that was violated; empty: the flight did not fail
  std::optional<double> time_s = {};      // of the violation; none: the criterion has no time
  std::string reason = {};                // one line
  std::vector<std::int64_t> activations;  // of each fault, in the scenario's order
  bool was_flown = true;                  // false: the scenario is not valid, which costs no flight
};
// A flight that is an error, or that cannot be judged, did not fail.
Flown FlownAs(const FlightResult& result);

// None: the search is to end, as after Ctrl-C. A scenario that cannot be flown did not fail. The same scenario gives the
// same answer.
using Evaluate = std::function<std::optional<Flown>(const Scenario&)>;

struct MinimiseStep {
  std::string what;           // "faults", "window of loss", "length"
  std::string before, after;  // equal where nothing smaller was found
  std::size_t runs = 0;
};

struct MinimiseFailureOptions {
  std::size_t runs_max = 250;     // flights in total, the first and the last included
  bool has_sensor_noise = false;  // the vehicle's file gives its sensors noise, so that it can be left out
  std::function<void(const MinimiseStep&)> on_step = [](const auto&) {};
};

struct SmallestFailure {
  Scenario scenario;  // without the criteria that are not violated first
  Flown first;        // the scenario that was given
  Flown last;         // the smallest
  std::size_t runs = 0;
  bool interrupted = false;
  bool out_of_runs = false;  // a smaller one may have been found with more flights
  bool confirmed = false;    // flown once more at the end, it failed by the same criterion

  bool fails() const { return !first.criterion.empty(); }
};

// The choice of faults alone: each fault that is left is needed. `first`: what the scenario's flight was, if it is known.
SmallestFailure MinimiseFaults(const Scenario& scenario, const Evaluate& evaluate,
                               const MinimiseFailureOptions& options,
                               const std::optional<Flown>& first = std::nullopt);

// Then everything else: the path, the noise of the vehicle's sensors, windows to one control period, severities to 1 % of their distance from harmless, or of the larger
// of two levels on a logarithmic scale without such a distance, the length to two control periods.
SmallestFailure MinimiseFailure(const Scenario& scenario, const VehicleSignals& signals,
                                const Evaluate& evaluate, const MinimiseFailureOptions& options);

// One of the two searches, with its scenario and options: it asks only by `evaluate`.
using FailureSearch = std::function<SmallestFailure(const Evaluate& evaluate)>;

// The question that a search asks after these answers to those before; none: it has ended, with `result`.
std::optional<Scenario> NextQuestion(const FailureSearch& search, std::span<const Flown> answers,
                                     SmallestFailure& result);

// Questions that may come after the one that is open: the answers so far are known, and the others are guessed both ways.
// The nearest come first; `count` is the most. Empty before the first answer.
std::vector<Scenario> Foreseen(const FailureSearch& search, std::span<const Flown> answers,
                               std::size_t count);

}  // namespace tiltproof::harness
