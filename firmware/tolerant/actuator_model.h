// The actuators' response to a command, and the command that gives a wanted response.
//
//   ActuatorModel actuators;                  // healthy
//   actuators.rotor_effectiveness[0] = 0.7F;  // the right rotor gives 70 %
//   const Actuators command = actuators.CommandFor(wanted);
//   const Actuators delivered = actuators.Delivered(command);     // wanted, within the limits
#pragma once

#include <array>

#include "firmware/signals.h"
#include "firmware/tolerant/vehicle_dynamics.h"

namespace tiltproof::firmware {

struct ActuatorModel {
  // Right, left.
  std::array<float, 2> rotor_effectiveness = {1, 1};
  std::array<float, 2> servo_effectiveness = {1, 1};
  std::array<float, 2> servo_offset_nm{};
  HeldHinges held{};
  friend bool operator==(const ActuatorModel&, const ActuatorModel&) = default;

  // The same bits for healthy actuators.
  Actuators Delivered(const Actuators& command) const;

  // Within the actuators' limits. If one rotor cannot give its part, both give so much less: the difference, which
  // holds the vehicle level, comes before the lift.
  Actuators CommandFor(const Actuators& wanted) const;

  // CanDeliver(): true if all of it is within the limits. LacksThrustFor(): true if a rotor cannot give its thrust.
  bool CanDeliver(const Actuators& wanted) const;
  bool LacksThrustFor(const Actuators& wanted) const;
};

}  // namespace tiltproof::firmware
