// The flying vehicle: rigid bodies, hinges and ground in ODE, stepped on a fixed grid (paper, section 2.2: 4
// ms).
//
//   VehicleModel model = LoadVehicle("plant/models/tiltrotor.sdf", {}, warnings);
//   Plant plant(model, {.step_ns = 4 * kNsPerMs});
//   plant.Reset({2, 0, 0.5}, {0, 0, 0});
//   plant.Step(model.HoverInput());     // one step with the input held
//   std::vector<double> state(model.signals().states.size());
//   plant.State(state);                 // world rates
//
// A row of numbers has the order and the size of the vehicle's table (VehicleModel::signals); a row of
// another size is a broken invariant (link/check.h). No step allocates from the heap, except one at which the bodies' masses
// change.
//
// The plant knows no bytes and no faults: what a fault does to the vehicle comes as a Disturbance next to the
// input. Two plants with the same model and the same calls give the same bits. A plant is used by one thread
// at a time.
#pragma once

#include <array>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

#include "link/disturbance.h"
#include "link/time.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

struct PlantOptions {
  TimeNs step_ns = 4 * kNsPerMs;  // > 0
  // The surroundings of the vehicle. Without ground and gravity, energy and momentum are conserved: for
  // checks.
  double gravity_m_s2 = kGravity_m_s2;
  bool ground = true;  // the plane z = 0
  // The ground carries the vehicle, and a touch is an event only above this normal speed of the touching point (>= 0),
  // or at a tilt above kTouchTiltMax_rad. None: each touch is an event.
  std::optional<double> touch_down_max_m_s = {};
  SensorDraws sensor_draws = {};  // of the noise of the file's sensors; none: they have no noise
};

inline constexpr double kTouchTiltMax_rad = std::numbers::pi / 3;

// The physics engine refuses the model (an inertia it cannot integrate), or the options are out of range.
struct PlantError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

enum class FlightEvent { kNone, kNotFinite, kTooFar, kTilted, kGroundStrike };

inline constexpr double kPositionMax_m = 1e3;

class Plant {
 public:
  // Starts as after Reset({0, 0, 1}, {0, 0, 0}). Throws PlantError.
  Plant(const VehicleModel& model, const PlantOptions& options);
  ~Plant();
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

  // Places the main body's frame origin (m, world) with Z-Y-X Euler angles roll, pitch, yaw (rad), servos at
  // their hover angles, everything at rest. Throws PlantError unless all values are finite.
  void Reset(const std::array<double, 3>& position_m, const std::array<double, 3>& attitude_rad);
  // The same at the height at which the lowest point of the vehicle's shapes touches the ground, to a nanometre.
  void ResetOnGround(double x_m, double y_m, const std::array<double, 3>& attitude_rad);
  // Sets positions and rates as given, angular rates along the world's axes. Angles of the servos must be
  // within their stops.
  void Reset(std::span<const double> state);

  // Changes no bit of a step.
  static constexpr Disturbance kUndisturbed{};
  // One step with the commands held. After the event kNotFinite (also caused by a command or a disturbance that is
  // not a number) the plant no longer moves.
  void Step(std::span<const double> command, const Disturbance& disturbance = kUndisturbed);
  // Changes a row of commands to the input that the next Step with them puts in force: saturated to the model's
  // limits, then thrusts by their rotors' lag. A lag covers the share 1 - exp(-step / time constant) of the way from
  // the thrust in force to the command, and the result holds for the step. After Reset the hover input is in force.
  void InputInForce(std::span<double> command) const;

  // Fills in the true state; angular rates in the requested frame. Yaw is in (-pi, pi].
  void State(std::span<double> state, RatesFrame frame = RatesFrame::kWorld) const;
  // Fills in the sensors: first the state when they last sampled (model.sensor_rate_hz, from Reset on), State()
  // of the first step boundary at or after their sampling time. The same as State() for sensors that sample at
  // every step. Then follows what Measure() gives.
  void ReadSensors(std::span<double> sensors, RatesFrame frame = RatesFrame::kWorld) const;
  // Fills in what the sensors of the vehicle's file read now (VehicleSignals::measured).
  void Measure(std::span<double> readings) const;

  // The first of: not finite; |position| > kPositionMax_m; tilt beyond 90 deg; a touch of the ground that the options
  // do not allow. Kept until Reset.
  FlightEvent Event() const;
  // The body and value of the event, for a person; empty for kNone.
  std::string EventText() const;

  // True while a shape touches the ground.
  bool OnGround() const;
  // Height of the shapes' lowest point above the plane z = 0 (m).
  double Clearance_m() const;

  // Sum of kinetic and potential energy (J), linear momentum (kg m/s) and angular momentum about the world
  // origin (kg m^2/s): for checks.
  double Energy() const;
  std::array<double, 6> Momentum() const;
  // Largest distance between a hinge's two anchor points (m).
  double HingeGap() const;

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace tiltproof::plant
