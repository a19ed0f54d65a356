// Content of the page of a report on one flight, as far as its files are there. Computes nothing by itself: criteria
// and their robustness come from the scorer, signals from the trace.
//
//   const FlightView view = ViewFlight(folder, result, scenario, vehicle);
//   for (const FaultBand& band : view.bands) Draw(band.begin_s, band.end_s);
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "harness/engine/flight_result.h"
#include "harness/report/line_frames.h"
#include "harness/report/why_file.h"
#include "harness/run/trace.h"
#include "harness/scenario/scenario.h"
#include "harness/score/stl.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

// The vehicle's geometry, for its picture: all in the frame of the main body, hinges at angle 0. A rotor that does not
// tilt has its own position for a hinge point, and the axis 0 0 0.
struct RotorShape {
  std::string name;
  std::vector<double> position_m, hinge_point_m, hinge_axis, thrust_axis;  // three numbers each
  double force_max_n = 0;
  std::string angle, force;  // columns of the trace; the angle's is empty for a rotor that does not tilt
  TILTPROOF_FIELDS(name, position_m, hinge_point_m, hinge_axis, thrust_axis, force_max_n, angle, force)
};
struct VehicleShape {
  std::string name;
  std::vector<double> body_size_m, body_position_m;
  std::vector<RotorShape> rotors;
  TILTPROOF_FIELDS(name, body_size_m, body_position_m, rotors)
};

// A fault's active time, in whole rows of the trace.
struct FaultBand {
  std::size_t fault = 0;
  double begin_s = 0, end_s = 0;
  TILTPROOF_FIELDS(fault, begin_s, end_s)
};
struct FaultTick {
  std::size_t fault = 0;
  double time_s = 0;
  std::string what;  // empty beyond the first kToldActivationsMax of a fault
};
// Times of rows are in the page as distances of 32 bits.
inline constexpr TimeNs kRowDistanceMax_ns = std::numeric_limits<std::uint32_t>::max();
inline constexpr std::size_t kBandsMax = 1'000;          // per fault
inline constexpr std::size_t kTicksMax = 5'000;          // per flight
inline constexpr std::size_t kToldActivationsMax = 100;  // per fault
inline constexpr std::size_t kLineErrorsMax = 2'000;     // per flight
inline constexpr std::size_t kEventsMax = 500;
inline constexpr std::size_t kTextBytesMax = 64'000;  // of a text file that is shown whole

// A bound that a criterion puts on a signal at all times of a window: an `always` over comparisons with numbers.
struct SignalBound {
  std::string criterion, signal;
  bool of_magnitude = false;  // of the signal's absolute value
  bool upper = true;
  double value = 0, begin_s = 0;
  std::optional<double> end_s;  // none: the end of the flight
  TILTPROOF_FIELDS(criterion, signal, of_magnitude, upper, value, begin_s, end_s)
};
std::vector<SignalBound> BoundsOf(const Scenario& scenario, const std::vector<std::string>& columns);

// Reading of the robustness of a criterion over time (harness/score/stl.h).
struct RobustnessCurve {
  std::string criterion;
  stl::OverTimeReading reading = stl::OverTimeReading::kLowest;
  bool looks_ahead = false;
  TILTPROOF_FIELDS(criterion, reading, looks_ahead)
};

struct FlightView {
  std::filesystem::path folder;
  FlightResult result;
  Scenario scenario;
  std::optional<VehicleShape> vehicle;
  std::string resolved;  // scenario.resolved.yaml

  Trace trace;  // empty: the flight left none
  std::vector<TimeNs> times_ns;
  std::vector<SignalBound> bounds;
  struct Series {
    std::string name;
    std::vector<double> values;  // one per row
  };
  // Signals, then criteria: robustness_lower/<name> and robustness_upper/<name>, NaN outside their windows.
  std::vector<Series> computed;
  std::vector<RobustnessCurve> robustness;
  std::optional<WhyFile> why;  // its curve is in `computed`: why/probability, why/low, why/high
  std::vector<FaultBand> bands;
  std::vector<FaultTick> ticks;
  std::vector<FlightEvent> events;  // the first kEventsMax
  std::string firmware_log;         // of all clients
  LinkLog link;
  std::vector<LineFrame> frames;
  std::vector<std::string> problems;  // files that could not be read
};

// `result` is the flight's entry in results.json. Never throws: what cannot be read is named in `problems`.
FlightView ViewFlight(const std::filesystem::path& folder, const FlightResult& result,
                      const Scenario& scenario, const std::optional<VehicleShape>& vehicle);

// Times at which a person looks closely: violations first, then fault edges and line errors in order of time.
std::vector<double> MomentsOf(const FlightView& view);

}  // namespace tiltproof::harness
