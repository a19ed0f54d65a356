// A scenario: what is flown, through which line, with which faults, and what counts as success. Plain data,
// no YAML here.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "faults/fault.h"
#include "link/messages.h"
#include "link/time.h"

namespace tiltproof::harness {

// Verdicts in order of precedence, weakest first: error > fail > inconclusive > pass.
enum class Verdict : std::uint8_t { kPass, kInconclusive, kFail, kError };
std::string_view Name(Verdict verdict);

enum class AngularRates : std::uint8_t { kWorld, kBody, kEuler };
std::string_view Name(AngularRates rates);

struct LinkSpec {
  bool ideal = false;  // zero byte time
  std::int64_t baud = 921'600;
  link::Dialect dialect = link::Dialect::kPaper;
  double adapter_latency_ms = 0.0;
  friend bool operator==(const LinkSpec&, const LinkSpec&) = default;
};

// The references of the base station. All positions in the world frame; yaw 0 unless stated.
struct HoverReference {
  std::array<double, 3> at_m{};
  double yaw_rad = 0.0;
  friend bool operator==(const HoverReference&, const HoverReference&) = default;
};
// Paper, eq. (1).
struct SpiralReference {
  double turns_count = 3, radius_m = 5, height_m = 10;
  std::array<double, 3> start_m = {2, 0, 0.5};
  double time_s = 60;  // T_f; afterwards the end point is held
  friend bool operator==(const SpiralReference&, const SpiralReference&) = default;
};
struct WaypointsReference {
  std::vector<std::array<double, 3>> points_m;
  double speed_m_s = 1.0;
  friend bool operator==(const WaypointsReference&, const WaypointsReference&) = default;
};
struct CircleReference {
  double radius_m = 5, period_s = 20;
  std::array<double, 3> start_m = {0, 0, 1};
  friend bool operator==(const CircleReference&, const CircleReference&) = default;
};
struct EightReference {
  double width_m = 5, period_s = 20;
  std::array<double, 3> start_m = {0, 0, 1};
  friend bool operator==(const EightReference&, const EightReference&) = default;
};
struct LineReference {
  std::array<double, 3> from_m{}, to_m{};
  double time_s = 60;
  friend bool operator==(const LineReference&, const LineReference&) = default;
};
// CSV: t_s,x_m,y_m,z_m,yaw_rad[,vx_m_s,vy_m_s,vz_m_s]
struct RecordedReference {
  std::filesystem::path file;
  friend bool operator==(const RecordedReference&, const RecordedReference&) = default;
};
struct ReferenceSpec {
  std::variant<HoverReference, SpiralReference, WaypointsReference, CircleReference, EightReference,
               LineReference, RecordedReference>
      path = SpiralReference{};
  bool velocity = true;  // false: the velocity components are sent as 0
  friend bool operator==(const ReferenceSpec&, const ReferenceSpec&) = default;
};

struct CriterionSpec {
  std::string name;
  // Either a formula...
  std::string stl;
  // ... or a metric with bounds.
  std::string metric;
  std::optional<double> min, max;
  friend bool operator==(const CriterionSpec&, const CriterionSpec&) = default;
};

struct Scenario {
  std::filesystem::path file;  // where it was read from
  std::string name;
  std::string description;
  std::vector<std::string> tags;
  std::string model = "tiltrotor";   // as written
  std::filesystem::path model_file;  // resolved
  std::string firmware = "paper";
  Verdict expect = Verdict::kPass;
  std::uint64_t seed = 1;
  TimeNs duration_ns = 0;
  TimeNs step_ns = 4 * kNsPerMs;
  AngularRates angular_rates = AngularRates::kWorld;  // of the sensors sent; the trace's are world rates
  bool allow_invalid_inertia = false;
  std::array<double, 3> initial_position_m{};  // default: the reference's start
  std::array<double, 3> initial_attitude_rad{};
  LinkSpec link;
  ReferenceSpec reference;
  std::vector<faults::FaultSpec> faults;
  std::vector<CriterionSpec> criteria;
};

}  // namespace tiltproof::harness
