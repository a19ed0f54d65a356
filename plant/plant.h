// The flying vehicle: rigid bodies, hinges and ground in ODE, stepped on a fixed grid (paper, section 2.2: 4 ms).
//
//   VehicleModel model = LoadVehicle("plant/models/tiltrotor.sdf", {}, warnings);
//   Plant plant(model, {.step_ns = 4'000'000});
//   plant.Reset({2, 0, 0.5}, {0, 0, 0});
//   plant.Step(input);                  // one step with the input held
//   SensorsTruth state = plant.State(); // 16 sensors, world rates
//
// Knows no byte and no fault. Two plants with the same model and the same calls give the same bits.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "link/signals.h"
#include "link/time.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

struct PlantOptions {
  TimeNs step_ns = 4 * kNsPerMs;
};

// How the main body's angular velocity is expressed.
enum class RatesFrame { kWorld, kBody, kEuler };

enum class FlightEvent { kNone, kNotFinite, kTooFar, kTilted, kGroundStrike };

class Plant {
 public:
  Plant(const VehicleModel& model, const PlantOptions& options);
  ~Plant();
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

  // Places the main body's frame origin (m, world) with Z-Y-X Euler angles roll, pitch, yaw (rad), servos at their angles of hover,
  // everything at rest.
  void Reset(const std::array<double, 3>& position_m, const std::array<double, 3>& attitude_rad);

  // One step; inputs are saturated to the model's limits. Returns the saturated inputs, those in force.
  ActuatorsTruth Step(const ActuatorsTruth& input);
  // What Step would apply for this input.
  ActuatorsTruth Saturate(const ActuatorsTruth& input) const;

  // 16 sensors; angular rates in the frame asked for. Yaw is in (-pi, pi].
  SensorsTruth State(RatesFrame frame = RatesFrame::kWorld) const;

  // First of: not finite; |position| > 1 km; tilt beyond 90 deg; main body touching the ground. Sticky until Reset.
  FlightEvent Event() const;
  // Which body and value, for a person; empty for kNone.
  std::string EventText() const;

  // Sum of kinetic and potential energy (J), linear momentum (kg m/s) and angular momentum about the world origin (kg m^2/s): for checks.
  double Energy() const;
  std::array<double, 6> Momentum() const;
  // Largest distance between a hinge's two anchor points (m).
  double HingeGap() const;

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace tiltproof::plant
