// The control of the build `tolerant` in flight with its monitor in sight: the simulated plant, a line that loses and
// delays, sensors with noise, and faults of actuators.
//
//   const FlightRecord record = Fly({.noise = true, .seed = 3, .fault_s = 10, .fault = WeakRotor(0, 0.7)});
//   EXPECT_LT(record.noticed_s, 0.5);
#pragma once

#include <functional>
#include <limits>
#include <span>

#include "firmware/tolerant/vehicle_dynamics.h"
#include "link/disturbance.h"
#include "link/time.h"

namespace tiltproof::firmware {

// Changes the row of inputs in force (f_r, f_l, tau_r, tau_l) as the actuators do, and the disturbance: what else acts.
using FlightFault = std::function<void(std::span<double> input, Disturbance& disturbance)>;

// A sample, what the model predicted for it from the sample before and the commands, and the sample before.
using SampleObserver =
    std::function<void(const MotionState& sample, const MotionState& predicted, const MotionState& before)>;

struct FlightPlan {
  double duration_s = 30;
  bool spiral = true;  // otherwise it hovers
  // From so many seconds on, the reference is 1 m beside every other 5 s; 0: never.
  double jumps_from_s = 0;
  // The vehicle, times the model's.
  double mass = 1, inertia = 1, drag_torque = 1;
  double wind_m_s = 0;  // from the side, from 10 s on
  bool noise = false;
  double drop = 0;      // of replies and of commands, each, from 5 s on
  TimeNs delay_ms = 0;  // of commands
  unsigned seed = 1;
  double fault_s = 10;
  FlightFault fault = nullptr;
  SampleObserver observe = nullptr;
};

struct FlightRecord {
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  double noticed_s =
      kNever;  // after the fault, a rotor is called weak, or commands take a deviation into account
  double jam_noticed_s = kNever;  // after the fault
  double descent_s = kNever;      // after the fault
  double false_alarm_s = kNever;  // before the fault: any of these
  // From 8 s on, when the flight has settled.
  double tilt_max_rad = 0;
  double error_max_m = 0;                      // distance from the path
  double sink_max_m_s = 0, climb_max_m_s = 0;  // from one second after the descent began
  double lowest_m = kNever;
};

FlightRecord Fly(const FlightPlan& plan);

FlightFault WeakRotor(unsigned rotor, double factor);   // actuator.loss_of_effectiveness
FlightFault LessThrust(unsigned rotor, double factor);  // plant.thrust
FlightFault JammedServo(unsigned hinge);

}  // namespace tiltproof::firmware
