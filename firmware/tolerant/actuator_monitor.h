// Estimates how much of its command each actuator delivers, from the vehicle's accelerations between two samples. The
// part that the model leaves unexplained is an actuator's surplus or deficit against its command.
//
//   ActuatorMonitor monitor;
//   monitor.Update(timeline, step, sample, line_is_good);          // before timeline.Correct(step, sample)
//   if (monitor.acts()) command = monitor.model().CommandFor(wanted);
//
// At first the model is that of healthy actuators. It changes when a deviation is larger than the sensors' noise and
// other vehicles (mass +2 %, inertia +10 %, drag torque +20 %) explain. docs/tolerant.md has the equations.
#pragma once

#include <array>

#include "firmware/tolerant/actuator_model.h"
#include "firmware/tolerant/motion_timeline.h"

namespace tiltproof::firmware {

class ActuatorMonitor {
 public:
  // Estimates from the motion since the timeline's last sample, and gives the timeline what is believed.
  // While the line is in doubt, no further servo is: a command that did not arrive looks like a servo's fault.
  void Update(MotionTimeline& timeline, ModelStep step, const MotionState& sample, bool line_is_good);

  // The model that is believed; that of healthy actuators unless acts().
  const ActuatorModel& model() const { return model_; }
  bool acts() const { return model_ != ActuatorModel{}; }
  // True if any actuator is faulty, also one that no command can make up for.
  bool faulty() const {
    return acts() || rotors_late_ > 0 || servos_[0].unanswered_samples > 0 ||
           servos_[1].unanswered_samples > 0 || stands_still(0) || stands_still(1);
  }

  // Right, left. Of one rotor: a load, or wind, weighs on both.
  bool weak_rotor(unsigned i) const;
  // True if the last sample shows a motion that neither late nor lost commands cause. Such is one hinge alone, or a
  // twist of the body that no servo gives.
  bool not_the_line() const { return not_the_line_; }
  // A hinge that its servo should move, and does not: noticed, and then believed.
  bool stands_still(unsigned i) const;
  bool jammed(unsigned i) const { return model_.held[i]; }

 private:
  // Over one interval between samples.
  struct Interval {
    float duration_s = 0;
    bool line_is_good = false;
    Actuators command;    // mean
    Actuators delivered;  // as believed
    MotionState before, predicted, sample;
    InputEffects effects;
  };
  // Extent of a value's swing about its slow mean. A step stays within twice that, a swing about 0 within 1.42 times.
  struct Swing {
    float mean = 0, square = 0;
    void Update(float value);
    bool IsExceededBy(float value) const;
  };
  // Means of a rotor's thrust over some 3 s: longer than a command takes to drift away from a thrust that stays.
  struct ThrustMean {
    float command_n = 0, delivered_n = 0;  // 0 before the first
    void Update(float now_command_n, float now_delivered_n);
  };
  // A servo's deviation: what it delivers beyond its command.
  struct Servo {
    float offset_nm = 0, variance_nm2 = 0;  // estimated
    float slope = 0;                        // change of the deviation with the command; 0: none to be seen
    bool dead = false;                      // what it delivers does not change with the command
    // Sums over the samples, older ones fading: 1, command, deviation and their products.
    float weight = 0, command = 0, deviation = 0, command2 = 0, product = 0, deviation2 = 0;
    Swing swing;
    float jam_evidence = 0;
    float still_evidence = 0;
    // Mean squares of the hinge's rate and turn that the model misses; at first more than any sensor's noise.
    float rate_scatter2 = 1, turn_scatter2 = 1;
    float before_nm = 0;  // delivered, as believed, in the interval before
    int seen = 0;         // samples in a row that deviate
    int slope_seen = 0;   // and that have a slope
    int steps_left = 0;   // how often the estimate may start again, in parts
    float unexpected_rad_s = 0;
    // When what is believed was first made up for.
    float begin_command_nm = 0, begin_delivered_nm = 0, begin_effectiveness = 1;
    bool acted = false;  // the last command made up for it
    int unanswered_samples =
        0;  // for which nothing is made up for, because the servo did not do what was asked
  };

  using Thrusts = std::array<float, 2>;  // right, left
  void UpdateRotors(const Interval& interval);
  // Follows the motion that no rotor causes.
  void UpdateDisturbance(const Interval& interval);
  // Estimates both rotors; true if one of them deviates.
  bool EstimateRotors(const Interval& interval, const Thrusts& command_n);
  bool RotorDeviates(unsigned i, float command_n, float own_rad_s, float own_m_s, float variance_n2);
  // Takes the belief in both back when one does not do what was asked to make up for it.
  void ProveRotors(const Thrusts& command_n);
  void UpdateServo(const Interval& interval, unsigned i);
  struct ServoSample;
  ServoSample SampleOf(const Interval& interval, unsigned i, float before_nm) const;
  void ForgetServo(unsigned i);
  // True if the hinge turns as by a torque that lasts for the whole interval.
  static bool TurnsThroughout(const Interval& interval, unsigned i, const ServoSample& sample);
  void BelieveServo(const Interval& interval, unsigned i, const ServoSample& sample, bool step, bool lost);
  // Takes a belief back when the servo does not do what is asked to make up for it.
  void ProveServo(unsigned i, float command_nm, float delivered_nm, float noise_nm, bool deviates,
                  bool arrived);
  void FitServo(Servo& servo, float command_nm, float deviation_nm, bool anew) const;
  void UpdateJam(const Interval& interval, unsigned i, float free_rad_s, float lost_rad_s);
  void UpdateStill(const Interval& interval, unsigned i, float free_rad_s, float lost_rad_s);

  ActuatorModel model_;
  std::array<float, 2> rotor_estimate_ = {1, 1};
  std::array<Swing, 2> rotor_swings_;
  std::array<ThrustMean, 2> rotor_means_;
  // Unexplained, per sample. A rotor rolls and lifts the vehicle; what pitches or yaws it more is something else: a
  // hinge's angle that is read wrongly, a shifted load. So is what pushes it more across its lift: a gust.
  float pitch_rad_s_ = 0, yaw_rad_s_ = 0;
  float ahead_m_s_ = 0, aside_m_s_ = 0;
  float sum_scatter_n2_ = 0, difference_scatter_n2_ = 0;
  int rotors_seen_ = 0;  // samples in a row with a deviation
  int rotors_late_ = 0;  // samples for which they are not believed, because a rotor did not do what was asked
  int believed_samples_ = 0;
  std::array<float, 2> settled_command_n_{};  // a while after a deviation was believed
  float settled_difference_n_ = 0;            // of the thrusts, then
  std::array<Servo, 2> servos_;
  bool not_the_line_ = false;
};

}  // namespace tiltproof::firmware
