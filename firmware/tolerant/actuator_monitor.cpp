#include "firmware/tolerant/actuator_monitor.h"

#include <algorithm>

namespace tiltproof::firmware {
namespace {

constexpr float kIntervalStep_s = static_cast<float>(ToSeconds(kModelStepNs));
// Between samples further apart the model itself is too uncertain.
constexpr ModelStep kStepsMax = 8;

// Rotors. Shares of a sample in the estimate: roll tells the difference of the thrusts at once, the lift their sum
// ten times less precisely.
constexpr float kDifferenceGain = 0.4F;
constexpr float kSumGain = 0.15F;
constexpr float kScatterGain = 0.1F;
constexpr float kRotorDeviation = 0.06F;  // believed from here on
constexpr float kRotorSigmas = 3;
constexpr float kRotorEffectivenessMin = 0.3F, kRotorEffectivenessMax = 2;
constexpr float kThrustMin_n = 3;  // below, a thrust tells nothing of its share
constexpr int kRotorSamples = 3;
// A fifth more asked for since the estimate settled, and less than that share of it got: the rotor is late or stuck, and more would be too
// much. It is left alone until nothing has deviated for 3 s.
constexpr float kAsked = 0.2F;
constexpr float kResponse = 0.25F;
constexpr int kSettledSamples = 6;
constexpr int kLateSamples = 250;

// A deviation is larger than this multiple of the swing.
constexpr float kSwingFactor = 1.7F;
constexpr float kSwingGain = 0.02F;
// A rotor's thrust and command are compared with their means over some 3 s.
constexpr float kThrustGain = 4e-3F;

// Servos.
constexpr float kHingeNoise_rad_s = 0.045F;
constexpr float kServoFading = 0.9F;
constexpr float kServoOffset_nm = 0.01F;  // believed from here on
constexpr float kServoSigmas = 4;
constexpr int kServoSamples = 8;
// A deviation is steady when the estimate foretold it to so much. One that the paper's command does not ride out is
// not waited for.
constexpr float kSteady = 0.25F;
constexpr float kUrgent_nm = 0.3F;
// A hinge that gets so much faster than it should, and turns accordingly, has another torque than before.
constexpr float kStep_rad_s = 1.5F;
constexpr float kTurnNoise_rad = 3e-3F;
// Share of a change of rate over an interval, in steps of 4 ms, that turns the hinge.
constexpr float kTurnShare = 2.0F / 3;
// A servo that gives less than so much of its command's changes; commands that change distinguish it from an offset.
constexpr float kSlope = 0.4F;
constexpr float kSlopeMin = -0.9F;
// A servo that gives nothing of them, as within a dead band, is not asked for more: it would come all at once.
constexpr float kSlopeDead = -0.95F;
constexpr float kSlopeCorrelation = 0.9F;
constexpr float kSlopeSamples = 5;
constexpr float kSlopeCommand_nm = 2e-3F;
constexpr int kSlopeProof = 4;
// Made up for step by step, so that a share that is none costs little: feedback makes commands follow a swing, too.
constexpr float kWeakening = 0.7F;
// So often, and again after so many samples.
constexpr int kStepCount = 3;
constexpr int kStepRecovery = 40;
constexpr float kAngleMax_rad = 1.4F;

// A jam: twice the logarithm of its likelihood against that of a hinge that is free.
constexpr float kJamFading = 0.98F;
constexpr float kJamSampleEvidence = 9;
constexpr float kJamCostMax = 6;  // of a hinge that is held
constexpr float kJamBelief = 24;
constexpr float kJamEvidence = 36;
constexpr float kHingeSpread_rad = 2e-3F;
constexpr float kLostCost = 5;  // of a command that was lost on a line that is good

// A hinge that stands still is noticed before it is believed. What is noticed changes the state, not the command; a
// servo within its dead band looks like that, too. Its noise is twice the scatter of what the model misses of the hinge,
// from this to the above, so that quiet sensors show it sooner.
constexpr float kQuietHinge_rad_s = 6e-4F;
constexpr float kQuietHinge_rad = 2e-5F;
constexpr float kHingeScatterGain = 0.02F;
constexpr float kHingeScatterFactor2 = 4;
constexpr float kStillCostMax = 9;
constexpr float kStillSampleEvidence = 12;
constexpr float kStillNotice = 24;

// A motion that the line cannot cause: a hinge, or the body's pitch, so much faster.
constexpr float kAlone_rad_s = 0.3F;
constexpr float kAloneShare = 0.1F;

float Square(float value) { return value * value; }
float Magnitude(float value) { return value < 0 ? -value : value; }

// True if the last samples deviate, `samples` in a row.
bool Lasts(bool deviates, int samples, int& seen) {
  seen = deviates ? std::min(seen + 1, samples + 1) : 0;
  return seen >= samples;
}

}  // namespace

void ActuatorMonitor::Swing::Update(float value) {
  square += kSwingGain * (Square(value - mean) - square);
  mean += kSwingGain * (value - mean);
}

bool ActuatorMonitor::Swing::IsExceededBy(float value) const {
  return Square(value) > Square(kSwingFactor) * square;
}

void ActuatorMonitor::ThrustMean::Update(float now_command_n, float now_delivered_n) {
  // Before the first update the rotor counts as healthy: it delivers its command.
  if (command_n == 0) command_n = delivered_n = now_command_n;
  command_n += kThrustGain * (now_command_n - command_n);
  delivered_n += kThrustGain * (now_delivered_n - delivered_n);
}

void ActuatorMonitor::Update(MotionTimeline& timeline, ModelStep step, const MotionState& sample,
                             bool line_is_good) {
  const ModelStep count = step - timeline.last_sample_step();
  if (count <= 0 || count > kStepsMax) return;
  Interval interval;
  interval.line_is_good = line_is_good && timeline.lag() == 0;
  interval.duration_s = kIntervalStep_s * static_cast<float>(count);
  interval.command = timeline.MeanCommand(step, count);
  interval.delivered = model_.Delivered(interval.command);
  interval.before = timeline.last_sample();
  interval.predicted = timeline.At(step);
  interval.sample = sample;
  interval.effects = ComputeInputEffects(kTiltrotorConstants, interval.before);
  UpdateRotors(interval);
  UpdateServo(interval, 0);
  UpdateServo(interval, 1);

  const float right_rad_s = Magnitude(servos_[0].unexpected_rad_s);
  const float left_rad_s = Magnitude(servos_[1].unexpected_rad_s);
  const float most_rad_s = std::max(right_rad_s, left_rad_s);
  const bool one_hinge =
      most_rad_s > kAlone_rad_s && std::min(right_rad_s, left_rad_s) < kAloneShare * most_rad_s;
  const float pitch_rad_s =
      Magnitude(Dot(interval.before.R_WB.y, sample.w_WB_rad_s - interval.predicted.w_WB_rad_s));
  not_the_line_ = one_hinge || (pitch_rad_s > kAlone_rad_s && most_rad_s < pitch_rad_s);
  timeline.SetActuators(model_);
}

void ActuatorMonitor::UpdateRotors(const Interval& interval) {
  const Thrusts command_n = {interval.command.f_r_n, interval.command.f_l_n};
  if (std::min(command_n[0], command_n[1]) < kThrustMin_n) return;
  UpdateDisturbance(interval);
  const bool deviates = EstimateRotors(interval, command_n);
  const bool believed = Lasts(deviates, kRotorSamples, rotors_seen_);
  believed_samples_ = believed ? std::min(believed_samples_ + 1, kSettledSamples + 1) : 0;
  if (rotors_late_ > 0 && !deviates) --rotors_late_;
  ProveRotors(command_n);
  if (rotors_late_ > 0) rotors_seen_ = believed_samples_ = 0;
  model_.rotor_effectiveness = believed && rotors_late_ == 0 ? rotor_estimate_ : Thrusts{1, 1};
}

void ActuatorMonitor::UpdateDisturbance(const Interval& interval) {
  const Matrix3& axes = interval.before.R_WB;
  const Vector3 turn_rad_s = interval.sample.w_WB_rad_s - interval.predicted.w_WB_rad_s;
  pitch_rad_s_ += kDifferenceGain * (Dot(axes.y, turn_rad_s) - pitch_rad_s_);
  yaw_rad_s_ += kDifferenceGain * (Dot(axes.z, turn_rad_s) - yaw_rad_s_);
  const Vector3 push_m_s = interval.sample.v_WC_m_s - interval.predicted.v_WC_m_s;
  ahead_m_s_ += kSumGain * (Dot(axes.x, push_m_s) - ahead_m_s_);
  aside_m_s_ += kSumGain * (Dot(axes.y, push_m_s) - aside_m_s_);
}

bool ActuatorMonitor::EstimateRotors(const Interval& interval, const Thrusts& command_n) {
  const Matrix3& axes = interval.before.R_WB;
  const float roll_rad_s = Dot(axes.x, interval.sample.w_WB_rad_s - interval.predicted.w_WB_rad_s);
  const float lift_m_s = Dot(axes.z, interval.sample.v_WC_m_s - interval.predicted.v_WC_m_s);
  const InputEffects& effects = interval.effects;
  const float lift = 0.5F * (effects.thrust_lift_m_s2[0] + effects.thrust_lift_m_s2[1]);
  const float roll = 0.5F * (effects.thrust_roll_rad_s2[0] - effects.thrust_roll_rad_s2[1]);

  const Thrusts estimated_n = {rotor_estimate_[0] * command_n[0], rotor_estimate_[1] * command_n[1]};
  const float sum_n = interval.delivered.f_r_n + interval.delivered.f_l_n +
                      lift_m_s / (lift * interval.duration_s) - estimated_n[0] - estimated_n[1];
  const float difference_n = interval.delivered.f_r_n - interval.delivered.f_l_n +
                             roll_rad_s / (roll * interval.duration_s) - estimated_n[0] + estimated_n[1];
  sum_scatter_n2_ += kScatterGain * (Square(sum_n) - sum_scatter_n2_);
  difference_scatter_n2_ += kScatterGain * (Square(difference_n) - difference_scatter_n2_);
  const Thrusts change_n = {0.5F * (kSumGain * sum_n + kDifferenceGain * difference_n),
                            0.5F * (kSumGain * sum_n - kDifferenceGain * difference_n)};
  // Variance of the mean over the last samples, if they do not depend on each other.
  const float variance_n2 =
      0.25F * 0.5F * (kSumGain * sum_scatter_n2_ + kDifferenceGain * difference_scatter_n2_);
  bool deviates = false;
  for (unsigned i = 0; i < 2; ++i) {
    rotor_estimate_[i] = std::clamp(rotor_estimate_[i] + change_n[i] / command_n[i], kRotorEffectivenessMin,
                                    kRotorEffectivenessMax);
    const float own_rad_s = roll * interval.duration_s * command_n[i];
    const float own_m_s = lift * interval.duration_s * command_n[i];
    if (RotorDeviates(i, command_n[i], own_rad_s, own_m_s, variance_n2)) deviates = true;
  }
  return deviates;
}

bool ActuatorMonitor::RotorDeviates(unsigned i, float command_n, float own_rad_s, float own_m_s,
                                    float variance_n2) {
  const float deviation2 = Square(rotor_estimate_[i] - 1);
  rotor_swings_[i].Update(rotor_estimate_[i] - 1);
  const float delivered_n = rotor_estimate_[i] * command_n;
  ThrustMean& mean = rotor_means_[i];
  mean.Update(command_n, delivered_n);
  const bool explains = rotors_seen_ >= kRotorSamples ||
                        (Square(delivered_n - mean.delivered_n) > Square(command_n - mean.command_n) &&
                         deviation2 * Square(own_rad_s) > Square(pitch_rad_s_) + Square(yaw_rad_s_) &&
                         deviation2 * Square(own_m_s) > Square(ahead_m_s_) + Square(aside_m_s_));
  return explains && rotor_swings_[i].IsExceededBy(rotor_estimate_[i] - 1) &&
         deviation2 > Square(kRotorDeviation) &&
         deviation2 * Square(command_n) > Square(kRotorSigmas) * variance_n2;
}

void ActuatorMonitor::ProveRotors(const Thrusts& command_n) {
  // The difference settles first.
  const float difference_now_n = rotor_estimate_[0] * command_n[0] - rotor_estimate_[1] * command_n[1];
  if (believed_samples_ <= kSettledSamples) {
    settled_command_n_ = command_n;
    settled_difference_n_ = difference_now_n;
  }
  if (believed_samples_ == 0) return;
  for (unsigned i = 0; i < 2; ++i) {
    const unsigned other = 1 - i;
    const float more_n =
        i == 0 ? difference_now_n - settled_difference_n_ : settled_difference_n_ - difference_now_n;
    const float got_n = more_n + rotor_estimate_[other] * (command_n[other] - settled_command_n_[other]);
    const float asked_n = command_n[i] - settled_command_n_[i];
    if (Square(rotor_estimate_[i] - 1) > Square(kRotorDeviation) &&
        Square(asked_n) > Square(kAsked * settled_command_n_[i]) &&
        got_n * asked_n < kResponse * rotor_estimate_[i] * Square(asked_n)) {
      rotors_late_ = kLateSamples;
    }
  }
}

// A hinge over one interval: Iyy (a . w' + alpha'') = tau.
struct ActuatorMonitor::ServoSample {
  float command_nm = 0, believed_nm = 0, before_nm = 0;
  float gain = 0;                          // rate per torque
  float before_rad_s = 0, free_rad_s = 0;  // at the begin; at the end, by the torque as believed
  float unexpected_rad_s = 0;
  float deviation_nm = 0, news_nm = 0;
};

ActuatorMonitor::ServoSample ActuatorMonitor::SampleOf(const Interval& interval, unsigned i,
                                                       float before_nm) const {
  const Servo& servo = servos_[i];
  ServoSample s;
  s.command_nm = i == 0 ? interval.command.tau_r_nm : interval.command.tau_l_nm;
  s.believed_nm = i == 0 ? interval.delivered.tau_r_nm : interval.delivered.tau_l_nm;
  s.before_nm = before_nm;
  s.gain = interval.duration_s / kTiltrotorConstants.thrusters[i].inertia_yy_kg_m2;
  const Vector3 axis = interval.before.R_WB * interval.effects.hinge_axes[i];
  s.before_rad_s = interval.before.alpha_rad_s[i];
  s.free_rad_s = s.before_rad_s + s.gain * s.believed_nm -
                 Dot(axis, interval.sample.w_WB_rad_s - interval.before.w_WB_rad_s);
  s.unexpected_rad_s = interval.sample.alpha_rad_s[i] - s.free_rad_s;
  s.deviation_nm = s.believed_nm + s.unexpected_rad_s / s.gain - s.command_nm;
  const float expected_nm = (1 + servo.slope) * s.command_nm + servo.offset_nm;
  s.news_nm = s.deviation_nm + s.command_nm - expected_nm;
  return s;
}

void ActuatorMonitor::UpdateServo(const Interval& interval, unsigned i) {
  Servo& servo = servos_[i];
  const float before_nm = servo.before_nm;
  servo.before_nm = i == 0 ? interval.delivered.tau_r_nm : interval.delivered.tau_l_nm;
  servo.unexpected_rad_s = 0;
  if (Magnitude(interval.sample.alpha_rad[i]) > kAngleMax_rad) return;

  const ServoSample s = SampleOf(interval, i, before_nm);
  // A share of a torque is no excuse for a hinge that stands still.
  const float asked_rad_s =
      s.free_rad_s + s.gain * (s.command_nm + model_.servo_offset_nm[i] - s.believed_nm);
  const float lost_rad_s = s.free_rad_s + s.gain * (s.before_nm - s.believed_nm);
  UpdateJam(interval, i, asked_rad_s, lost_rad_s);
  UpdateStill(interval, i, asked_rad_s, lost_rad_s);
  if (model_.held[i]) return ForgetServo(i);
  servo.unexpected_rad_s = s.unexpected_rad_s;

  const bool lost = Magnitude(s.unexpected_rad_s - s.gain * (s.before_nm - s.believed_nm)) <
                    0.3F * Magnitude(s.unexpected_rad_s);
  const bool step = TurnsThroughout(interval, i, s) && !lost && s.gain * Magnitude(s.news_nm) > kStep_rad_s &&
                    servo.steps_left > kStepRecovery;
  servo.steps_left =
      std::min(servo.steps_left + (step ? -kStepRecovery : 1), (kStepCount + 1) * kStepRecovery);
  FitServo(servo, s.command_nm, s.deviation_nm, step);
  if (!step) servo.variance_nm2 += kScatterGain * (Square(s.news_nm) - servo.variance_nm2);
  servo.swing.Update(servo.offset_nm);
  BelieveServo(interval, i, s, step, lost);
}

void ActuatorMonitor::ForgetServo(unsigned i) {
  Servo& servo = servos_[i];
  servo.offset_nm = servo.slope = servo.weight = servo.variance_nm2 = 0;
  model_.servo_effectiveness[i] = 1;
  servo.seen = servo.slope_seen = 0;
  model_.servo_offset_nm[i] = 0;
}

bool ActuatorMonitor::TurnsThroughout(const Interval& interval, unsigned i, const ServoSample& s) {
  const float unexpected_turn_rad =
      interval.sample.alpha_rad[i] - interval.before.alpha_rad[i] -
      interval.duration_s * (s.before_rad_s + kTurnShare * (s.free_rad_s - s.before_rad_s));
  const float turn_rad = s.unexpected_rad_s < 0 ? -unexpected_turn_rad : unexpected_turn_rad;
  const float whole_rad = interval.duration_s * Magnitude(s.unexpected_rad_s);
  return turn_rad > 0.2F * whole_rad - kTurnNoise_rad && turn_rad < 0.85F * whole_rad + kTurnNoise_rad;
}

void ActuatorMonitor::BelieveServo(const Interval& interval, unsigned i, const ServoSample& s, bool step,
                                   bool lost) {
  Servo& servo = servos_[i];
  const float noise_nm2 = std::max(Square(kHingeNoise_rad_s / s.gain), servo.variance_nm2) / servo.weight;
  // Both at once are the line's: commands that come late, or not at all.
  const Servo& other = servos_[1 - i];
  const bool believed_before = model_.servo_offset_nm[i] != 0;
  const bool alone = !servo.dead && (interval.line_is_good || believed_before) &&
                     other.deviation2 * servo.weight < kAloneShare * servo.deviation2 * other.weight;
  if (!alone) servo.slope = 0;
  const bool steady = Square(s.news_nm) < Square(kSteady * s.deviation_nm);
  const bool deviates =
      alone && servo.swing.IsExceededBy(servo.offset_nm) &&
      Square(servo.offset_nm) > std::max(Square(kServoOffset_nm), Square(kServoSigmas) * noise_nm2);
  const bool urgent = step && deviates && Square(s.deviation_nm) > Square(kUrgent_nm);
  if (urgent) servo.seen = kServoSamples;
  const bool believed = Lasts(deviates && (steady || urgent || believed_before), kServoSamples, servo.seen);
  const bool weak =
      Lasts(servo.slope < 0 && (steady || model_.servo_effectiveness[i] != 1), kSlopeProof, servo.slope_seen);
  model_.servo_offset_nm[i] = believed || weak ? servo.offset_nm : 0;
  model_.servo_effectiveness[i] =
      weak ? std::max(1 + servo.slope, kWeakening * model_.servo_effectiveness[i]) : 1;
  ProveServo(i, s.command_nm, s.deviation_nm + s.command_nm, kHingeNoise_rad_s / s.gain,
             deviates || servo.slope < 0, interval.line_is_good && !lost);
}

void ActuatorMonitor::ProveServo(unsigned i, float command_nm, float delivered_nm, float noise_nm,
                                 bool deviates, bool arrived) {
  Servo& servo = servos_[i];
  const bool weak = model_.servo_effectiveness[i] != 1;
  const bool acts = weak || model_.servo_offset_nm[i] != 0;
  if (servo.unanswered_samples > 0 && !deviates) --servo.unanswered_samples;
  if (servo.acted && arrived) {
    const float asked_nm = servo.begin_effectiveness * (command_nm - servo.begin_command_nm);
    const float missing_nm = asked_nm - (delivered_nm - servo.begin_delivered_nm);
    const bool unanswered = Square(asked_nm) > Square(kServoSigmas * noise_nm) &&
                            Square(missing_nm) > Square((1 - kResponse) * asked_nm);
    if (unanswered) servo.unanswered_samples = kLateSamples;
  }
  if (!servo.acted || weak != (servo.begin_effectiveness != 1)) {
    servo.begin_command_nm = command_nm;
    servo.begin_delivered_nm = delivered_nm;
    servo.begin_effectiveness = weak ? 1 + servo.slope : 1;
  }
  servo.acted = acts && servo.unanswered_samples == 0;
  if (servo.unanswered_samples == 0) return;
  model_.servo_offset_nm[i] = 0;
  model_.servo_effectiveness[i] = 1;
  servo.seen = servo.slope_seen = 0;
}

// A straight line through the last samples' deviations over their commands; level, unless it is clearly not.
void ActuatorMonitor::FitServo(Servo& servo, float command_nm, float deviation_nm, bool anew) const {
  const float fading = anew ? 0 : kServoFading;
  servo.weight = fading * servo.weight + 1;
  servo.command = fading * servo.command + command_nm;
  servo.deviation = fading * servo.deviation + deviation_nm;
  servo.command2 = fading * servo.command2 + Square(command_nm);
  servo.product = fading * servo.product + command_nm * deviation_nm;
  servo.deviation2 = fading * servo.deviation2 + Square(deviation_nm);
  const float command_mean = servo.command / servo.weight;
  const float deviation_mean = servo.deviation / servo.weight;
  const float command_square = servo.command2 - servo.weight * Square(command_mean);
  const float product = servo.product - command_mean * servo.deviation;
  const float deviation_square = servo.deviation2 - servo.weight * Square(deviation_mean);
  const bool clear = servo.weight > kSlopeSamples && command_square > Square(kSlopeCommand_nm) &&
                     Square(product) > kSlopeCorrelation * command_square * deviation_square &&
                     product < -kSlope * command_square;
  servo.dead = clear && product < kSlopeDead * command_square;
  servo.slope = clear && !servo.dead ? std::max(product / command_square, kSlopeMin) : 0;
  servo.offset_nm = deviation_mean - servo.slope * command_mean;
}

void ActuatorMonitor::UpdateJam(const Interval& interval, unsigned i, float free_rad_s, float lost_rad_s) {
  Servo& servo = servos_[i];
  const float rate_rad_s = interval.sample.alpha_rad_s[i];
  const float turn_rad = interval.sample.alpha_rad[i] - interval.before.alpha_rad[i];
  const float lost_cost = interval.line_is_good ? kLostCost : 0;
  const float free_cost = std::min(Square((rate_rad_s - free_rad_s) / kHingeNoise_rad_s),
                                   Square((rate_rad_s - lost_rad_s) / kHingeNoise_rad_s) + lost_cost);
  const float jam_cost = Square(rate_rad_s / kHingeNoise_rad_s) + Square(turn_rad / kHingeSpread_rad);
  const float evidence =
      jam_cost > kJamCostMax ? -kJamSampleEvidence : std::min(free_cost - jam_cost, kJamSampleEvidence);
  servo.jam_evidence = std::clamp(kJamFading * servo.jam_evidence + evidence,
                                  model_.held[i] ? -kJamEvidence : 0.0F, kJamEvidence);
  if (servo.jam_evidence > kJamBelief) model_.held[i] = true;
  if (servo.jam_evidence < 0) model_.held[i] = false;
}

void ActuatorMonitor::UpdateStill(const Interval& interval, unsigned i, float free_rad_s, float lost_rad_s) {
  Servo& servo = servos_[i];
  const float rate_rad_s = interval.sample.alpha_rad_s[i];
  const float before_rad_s = interval.before.alpha_rad_s[i];
  const float turn_rad = interval.sample.alpha_rad[i] - interval.before.alpha_rad[i];
  const float rate_variance = std::clamp(kHingeScatterFactor2 * servo.rate_scatter2,
                                         Square(kQuietHinge_rad_s), Square(kHingeNoise_rad_s));
  const float turn_variance = std::clamp(kHingeScatterFactor2 * servo.turn_scatter2, Square(kQuietHinge_rad),
                                         Square(kHingeSpread_rad));
  const auto missed_turn_rad = [&](float end_rad_s) {
    return turn_rad - interval.duration_s * (before_rad_s + kTurnShare * (end_rad_s - before_rad_s));
  };
  const auto cost = [&](float end_rad_s) {
    return Square(rate_rad_s - end_rad_s) / rate_variance +
           Square(missed_turn_rad(end_rad_s)) / turn_variance;
  };
  const float still_cost = Square(rate_rad_s) / rate_variance + Square(turn_rad) / turn_variance;
  const float moving_cost = std::min(cost(free_rad_s), cost(lost_rad_s) + kLostCost);
  const float evidence = still_cost > kStillCostMax
                             ? -kStillSampleEvidence
                             : std::min(moving_cost - still_cost, kStillSampleEvidence);
  // While the line is in doubt, a hinge stands still for want of commands.
  servo.still_evidence = std::clamp(
      kJamFading * servo.still_evidence + (interval.line_is_good ? evidence : std::min(evidence, 0.0F)), 0.0F,
      kJamEvidence);
  // Evidence for a hinge that stands still carries no information about one that moves.
  if (evidence > 0) return;
  servo.rate_scatter2 += kHingeScatterGain * (Square(rate_rad_s - free_rad_s) - servo.rate_scatter2);
  servo.turn_scatter2 += kHingeScatterGain * (Square(missed_turn_rad(free_rad_s)) - servo.turn_scatter2);
}

bool ActuatorMonitor::stands_still(unsigned i) const { return servos_[i].still_evidence > kStillNotice; }

bool ActuatorMonitor::weak_rotor(unsigned i) const {
  const float loss = 1 - model_.rotor_effectiveness[i];
  const float other = 1 - model_.rotor_effectiveness[1 - i];
  return loss > kRotorDeviation && loss > 2 * std::max(other, -other);
}

}  // namespace tiltproof::firmware
