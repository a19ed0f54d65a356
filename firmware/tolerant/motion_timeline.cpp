#include "firmware/tolerant/motion_timeline.h"

#include <algorithm>

namespace tiltproof::firmware {
namespace {

constexpr std::size_t RingIndex(ModelStep step, ModelStep count) {
  return static_cast<std::uint32_t>(step) % static_cast<std::uint32_t>(count);
}

}  // namespace

void MotionTimeline::Begin(ModelStep step, const MotionState& sample, const Actuators& in_force) {
  commands_.fill(in_force);
  command_step_ = step;
  lag_ = 0;
  Correct(step, sample);
}

void MotionTimeline::Command(ModelStep step, const Actuators& inputs) {
  const Actuators before = InForce(command_step_);
  const ModelStep filled = std::max(command_step_, step - kCommandCount);
  for (ModelStep i = filled + 1; i < step; ++i) commands_[RingIndex(i, kCommandCount)] = before;
  commands_[RingIndex(step, kCommandCount)] = inputs;
  command_step_ = step;
  computed_step_ = std::min(computed_step_, std::max(step + lag_, sample_step_));
}

void MotionTimeline::Correct(ModelStep step, const MotionState& sample) {
  sample_ = sample;
  sample_step_ = step;
  computed_step_ = step;
  states_[RingIndex(step, kStateCount)] = sample;
}

const MotionState& MotionTimeline::At(ModelStep step) {
  while (computed_step_ < step) {
    MotionState next = states_[RingIndex(computed_step_, kStateCount)];
    Step(computed_step_ - lag_, next);
    states_[RingIndex(++computed_step_, kStateCount)] = next;
  }
  return states_[RingIndex(step, kStateCount)];
}

MotionState MotionTimeline::Suppose(ModelStep count, ModelStep lag) const {
  MotionState state = sample_;
  for (ModelStep i = 0; i < count; ++i) {
    Step(sample_step_ + i - lag, state);
  }
  return state;
}

void MotionTimeline::SetLag(ModelStep lag) {
  lag_ = std::clamp(lag, ModelStep{0}, kLagMax);
  computed_step_ = sample_step_;
}

void MotionTimeline::SetActuators(const ActuatorModel& actuators) {
  if (actuators == actuators_) return;
  actuators_ = actuators;
  computed_step_ = sample_step_;
}

Actuators MotionTimeline::MeanCommand(ModelStep step, ModelStep count) const {
  Actuators mean;
  const float share = 1 / static_cast<float>(count);
  for (ModelStep i = step - count; i < step; ++i) {
    const Actuators& command = InForce(i - lag_);
    for (const auto& field : kActuatorFields) mean.*field.in_float += share * command.*field.in_float;
  }
  return mean;
}

void MotionTimeline::Step(ModelStep sent, MotionState& state) const {
  StepMotion(kTiltrotorConstants, actuators_.Delivered(InForce(sent)), state, actuators_.held);
}

const Actuators& MotionTimeline::InForce(ModelStep step) const {
  return commands_[RingIndex(std::clamp(step, command_step_ - kCommandCount + 1, command_step_),
                             kCommandCount)];
}

}  // namespace tiltproof::firmware
