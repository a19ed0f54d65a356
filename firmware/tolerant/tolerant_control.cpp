#include "firmware/tolerant/tolerant_control.h"

#include <algorithm>

#include "firmware/messages.h"
#include "firmware/tolerant/vehicle_parameters.h"

namespace tiltproof::firmware {
namespace {

// 26 bytes at 921600 baud, some of them escaped.
constexpr TimeNs kCommandFlightNs = 300 * kNsPerUs;

// After a fault the line is not trusted for so long: 3 s. Further commands in each period are for the line only: they
// follow the prediction, which other faults make worse.
constexpr int kLineDoubtPeriods = 250;

// A request that gets no reply is a loss on the line, for 1 s.
constexpr int kLossPeriods = 83;

// In a period, no later time-out is sure.
constexpr TimeNs kLastTimeoutNs = kControlPeriodNs - kModelStepNs;

constexpr float kModelStep_s = static_cast<float>(ToSeconds(kModelStepNs));

// A command that acts at most that many steps after the sample it answers is the paper's own: its design
// tolerates that, and no model is in between.
constexpr ModelStep kPaperSteps = 1;

// The screen compares a sample with the one before only when that is not much older.
constexpr int kDamagedMax = 2;

// Replies of one period whose lag is examined. A line that was held brings many at once, each of which costs some 7 %
// of the period.
constexpr int kExaminedMax = 4;

Reference Ahead(const Reference& reference, float time_s) {
  Reference ahead = reference;
  ahead.x_m += time_s * reference.vx_m_s;
  ahead.y_m += time_s * reference.vy_m_s;
  ahead.z_m += time_s * reference.vz_m_s;
  return ahead;
}

Actuators WithinLimits(const Actuators& wanted) {
  constexpr float kForceMax_n = kTiltrotorConstants.force_max_n;
  constexpr float kTorqueMax_nm = kTiltrotorConstants.torque_max_nm;
  return {.f_r_n = std::clamp(wanted.f_r_n, 0.0F, kForceMax_n),
          .f_l_n = std::clamp(wanted.f_l_n, 0.0F, kForceMax_n),
          .tau_r_nm = std::clamp(wanted.tau_r_nm, -kTorqueMax_nm, kTorqueMax_nm),
          .tau_l_nm = std::clamp(wanted.tau_l_nm, -kTorqueMax_nm, kTorqueMax_nm)};
}

}  // namespace

void TolerantControl::NoteRequest(const RequestTimes& request) {
  origin_ns_ = request.origin_ns;
  command_flight_ns_ = request.sent_ns == request.begin_ns ? 0 : kCommandFlightNs;
  period_step_ = StepAt(request.sent_ns);
  matcher_.Request(period_step_, request.sent_ns);
  answered_ = false;
  commanded_ = false;
  timed_out_ = refused_ = false;
  examined_count_ = 0;
  if (loss_periods_ > 0) --loss_periods_;
  supervisor_.BeginPeriod();
  descent_.BeginPeriod();
  if (line_doubt_periods_ > 0) --line_doubt_periods_;
}

std::optional<Actuators> TolerantControl::OnReply(TimeNs now, const Sensors& sensors,
                                                  const Reference& reference) {
  bool newest = true;
  if (accepted_.HasOlder(sensors)) return std::nullopt;
  const auto clean = Accept(now, sensors, newest);
  if (!clean) return std::nullopt;
  accepted_.Add(sensors);
  supervisor_.On(SupervisorEvent::kReply);
  new_sample_ = true;
  if (!newest || answered_) return std::nullopt;
  answered_ = true;
  if (commanded_ && LineIsSlow()) return std::nullopt;
  return Command(now, &*clean, reference);
}

std::optional<Sensors> TolerantControl::Accept(TimeNs now, const Sensors& sensors, bool& newest) {
  if (!has_sample_) {
    if (!link::IsPlausible(sensors)) return std::nullopt;
    has_sample_ = true;
    matcher_.CloseAll();
    timeline_.Begin(period_step_, ToMotion(sensors), hover_);
    screen_.Begin(sensors);
    supervisor_.On(SupervisorEvent::kReady);
    return sensors;
  }
  // The believed signals determine the instant that it shows.
  const MotionState probe = ToMotion(
      screen_.Patch(sensors, ToSensors(timeline_.At(std::max(period_step_, timeline_.last_sample_step())))));
  const auto step = matcher_.Match(probe, now, StepAt(now), timeline_);
  if (!step) return std::nullopt;
  newest = matcher_.answers_newest();
  replies_late_ = timed_out_ || !newest;
  if (matcher_.skipped()) loss_periods_ = kLossPeriods;
  const Sensors predicted = ToSensors(timeline_.At(*step));
  const ModelStep elapsed = *step - timeline_.last_sample_step();
  Sensors clean = screen_.Patch(sensors, predicted);
  // From rates that no vehicle has, the model and the screen soon compute what no vehicle does.
  bool anew = matcher_.lost() || !link::IsPlausible(predicted);
  if (!anew && lag_estimator_.model_is_right()) {
    screen_before_ = screen_;
    const Sensors screened = screen_.Screen(sensors, predicted, kModelStep_s * static_cast<float>(elapsed));
    // Few replies that are damaged are best done without. A sensor's fault is still there in the next.
    damaged_count_ = screen_.startled() && damaged_count_ < kDamagedMax ? damaged_count_ + 1 : 0;
    if (damaged_count_ > 0) {
      screen_ = screen_before_;
      supervisor_.On(SupervisorEvent::kFault);
      refused_ = true;
      return std::nullopt;
    }
    anew = !link::IsPlausible(screened);
    if (!anew) clean = screened;
  } else if (!anew) {
    screen_.Begin(clean);
  }
  if (anew) {
    if (link::IsPlausible(sensors)) clean = sensors;
    if (!link::IsPlausible(clean)) return std::nullopt;
    screen_.Begin(clean);
    timeline_.SetLag(0);
    lag_estimator_.Reset();
  } else {
    const MotionState sample = ToMotion(clean);
    actuator_monitor_.Update(timeline_, *step, sample, line_doubt_periods_ == 0);
    if (examined_count_ < kExaminedMax) {
      ++examined_count_;
      lag_estimator_.Update(timeline_, *step, sample);
      const bool line_surprises =
          lag_estimator_.surprised() && (timeline_.lag() != 0 || !actuator_monitor_.not_the_line());
      if (line_surprises) SuspectLine();
    }
    if (screen_.substitutes()) supervisor_.On(SupervisorEvent::kFault);
  }
  timeline_.Correct(*step, ToMotion(clean));
  return clean;
}

std::optional<Actuators> TolerantControl::OnTimeout(TimeNs now, const Reference& reference) {
  timed_out_ = true;
  if (!has_sample_ || (commanded_ && (line_doubt_periods_ == 0 || LineIsSlow()))) return std::nullopt;
  if (!answered_ && !refused_) SuspectLine();
  if (LineIsSlow() && matcher_.Expects(now, kLastTimeoutNs)) return std::nullopt;
  if (!lag_estimator_.model_is_right()) return last_command_;
  return Command(now, nullptr, reference);
}

ModelStep TolerantControl::StepAt(TimeNs now) const {
  return static_cast<ModelStep>((now - origin_ns_) / kModelStepNs);
}

Actuators TolerantControl::Command(TimeNs now, const Sensors* fresh, const Reference& received) {
  const Reference& reference = descent_.begun() ? descent_.reference() : received;
  const ModelStep step = StepAt(now + command_flight_ns_ + kModelStepNs - 1);
  const ModelStep acts = step + timeline_.lag();
  const bool as_paper = fresh != nullptr && (acts - timeline_.last_sample_step() <= kPaperSteps ||
                                             !lag_estimator_.model_is_right());
  // Nothing is summed up without a new sample, nor while the actuators cannot give more.
  const bool sums = new_sample_ && !commanded_ && !saturated_;
  const auto integration = sums ? Integration::kOn : Integration::kFrozen;
  if (as_paper) {
    last_command_ = law_.Step(*fresh, reference, integration);
  } else {
    const float ahead_s = kModelStep_s * static_cast<float>(acts - period_step_);
    // A prediction of no vehicle leaves the last command as it is: the law's integrals would keep it for ever.
    if (const Sensors predicted = ToSensors(timeline_.At(acts)); link::IsPlausible(predicted))
      last_command_ = law_.Step(predicted, Ahead(reference, ahead_s), integration);
  }
  const ActuatorModel& actuators = actuator_monitor_.model();
  saturated_ = !actuators.CanDeliver(last_command_);
  if (fresh != nullptr) WatchActuators(*fresh, received, actuators.LacksThrustFor(last_command_));
  last_command_ =
      actuator_monitor_.acts() ? actuators.CommandFor(last_command_) : WithinLimits(last_command_);
  new_sample_ = false;
  commanded_ = true;
  timeline_.Command(step, last_command_);
  return last_command_;
}

void TolerantControl::SuspectLine() {
  supervisor_.On(SupervisorEvent::kFault);
  line_doubt_periods_ = kLineDoubtPeriods;
}

void TolerantControl::WatchActuators(const Sensors& sensors, const Reference& reference,
                                     bool short_of_thrust) {
  const bool faulty = actuator_monitor_.faulty();
  if (faulty && !faulty_) supervisor_.On(SupervisorEvent::kActuatorFault);
  faulty_ = faulty;
  const bool descended = descent_.begun();
  descent_.Watch(sensors, reference, faulty, short_of_thrust);
  if (descent_.begun() && !descended) supervisor_.On(SupervisorEvent::kActuatorFailsafe);
}

}  // namespace tiltproof::firmware
