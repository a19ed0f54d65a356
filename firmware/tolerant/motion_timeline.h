// The vehicle's motion on a grid of model steps, from the last accepted sample into the future: samples and
// commands go in, predicted states come out.
//
//   timeline.Begin(step, sample, hover);                  // the first sample
//   timeline.Command(step + 1, actuators);                // in force from that step on
//   const MotionState& soon = timeline.At(step + 3);      // predicted
//   timeline.Correct(step + 3, next_sample);              // prediction starts again from there
//
// Steps are those of the firmware's own clock. Commands that act `lag` steps later than they were meant to (a
// delay on their way) are one number, SetLag. A round trip does not tell on which way a delay lies, and need
// not: a sample that is stamped late and commands that lag by as much predict the same.
#pragma once

#include <array>
#include <cstdint>

#include "firmware/tolerant/actuator_model.h"
#include "firmware/tolerant/vehicle_dynamics.h"

namespace tiltproof::firmware {

using ModelStep = std::int32_t;  // of kModelStepNs

class MotionTimeline {
 public:
  static constexpr ModelStep kStateCount = 64;  // remembered, up to the newest one computed: 256 ms
  static constexpr ModelStep kCommandCount = 128;
  static constexpr ModelStep kLagMax = 12;

  // Forgets everything; `in_force` is the input until the first command.
  void Begin(ModelStep step, const MotionState& sample, const Actuators& in_force);

  void Command(ModelStep step, const Actuators& inputs);

  // A sample newer than the last.
  void Correct(ModelStep step, const MotionState& sample);

  // The state at a step: from the last sample on, or at most kStateCount steps before the newest computed. Takes one
  // model step for each that is not computed yet.
  const MotionState& At(ModelStep step);

  // The state `count` steps after the last sample if the lag is `lag`.
  MotionState Suppose(ModelStep count, ModelStep lag) const;

  void SetLag(ModelStep lag);
  ModelStep lag() const { return lag_; }
  // The actuators' effect on commands; from the last sample on everything is predicted again.
  void SetActuators(const ActuatorModel& actuators);

  // The mean of the commands in force over the `count` steps before `step`, and that without the last of them.
  Actuators MeanCommand(ModelStep step, ModelStep count) const;
  ModelStep last_sample_step() const { return sample_step_; }
  const MotionState& last_sample() const { return sample_; }

 private:
  const Actuators& InForce(ModelStep step) const;
  void Step(ModelStep sent, MotionState& state) const;

  std::array<MotionState, kStateCount> states_;
  std::array<Actuators, kCommandCount> commands_{};  // in force, of each step up to command_step_
  ActuatorModel actuators_;
  MotionState sample_;
  ModelStep sample_step_ = 0;
  ModelStep computed_step_ = 0;  // states_ hold what is predicted up to here
  ModelStep command_step_ = 0;
  ModelStep lag_ = 0;
};

}  // namespace tiltproof::firmware
