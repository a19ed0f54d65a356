#include "firmware/tolerant_control.h"

namespace tiltproof::firmware {
namespace {

// 26 bytes at 921600 baud, some of them escaped.
constexpr TimeNs kCommandFlightNs = 300 * kNsPerUs;

constexpr float kModelStep_s = static_cast<float>(ToSeconds(kModelStepNs));

// A command that acts at most that many steps after the sample it answers is the paper's own: its design
// tolerates that, and no model is in between.
constexpr ModelStep kPaperSteps = 1;

Reference Ahead(const Reference& reference, float time_s) {
  Reference ahead = reference;
  ahead.x_m += time_s * reference.vx_m_s;
  ahead.y_m += time_s * reference.vy_m_s;
  ahead.z_m += time_s * reference.vz_m_s;
  return ahead;
}

}  // namespace

void TolerantControl::NoteRequest(const RequestTimes& request) {
  origin_ns_ = request.origin_ns;
  command_flight_ns_ = request.sent_ns == request.begin_ns ? 0 : kCommandFlightNs;
  period_step_ = StepAt(request.sent_ns);
  matcher_.Request(period_step_, request.sent_ns);
  answered_ = false;
  commanded_ = false;
  supervisor_.BeginPeriod();
}

std::optional<Actuators> TolerantControl::OnReply(TimeNs now, const Sensors& sensors,
                                                  const Reference& reference) {
  const MotionState sample = ToMotion(sensors);
  ModelStep step = period_step_;
  bool newest = true;
  if (!has_sample_) {
    has_sample_ = true;
    timeline_.Begin(step, sample, hover_);
    supervisor_.On(SupervisorEvent::kReady);
  } else {
    const auto match = matcher_.Match(sample, now, StepAt(now), timeline_);
    if (!match) return std::nullopt;
    step = *match;
    newest = matcher_.answers_newest();
    if (matcher_.lost()) {
      timeline_.SetLag(0);
      lag_estimator_.Reset();
    } else {
      lag_estimator_.Update(timeline_, step, sample);
      if (lag_estimator_.surprised()) supervisor_.On(SupervisorEvent::kFault);
    }
    timeline_.Correct(step, sample);
  }
  supervisor_.On(SupervisorEvent::kReply);
  new_sample_ = true;
  if (!newest || answered_) return std::nullopt;
  answered_ = true;
  return Command(now, &sensors, reference);
}

std::optional<Actuators> TolerantControl::OnTimeout(TimeNs now, const Reference& reference) {
  if (!has_sample_ || (commanded_ && !supervisor_.degraded())) return std::nullopt;
  if (!answered_) supervisor_.On(SupervisorEvent::kFault);
  if (!lag_estimator_.model_is_right()) return last_command_;
  return Command(now, nullptr, reference);
}

ModelStep TolerantControl::StepAt(TimeNs now) const {
  return static_cast<ModelStep>((now - origin_ns_) / kModelStepNs);
}

Actuators TolerantControl::Command(TimeNs now, const Sensors* fresh, const Reference& reference) {
  const ModelStep step = StepAt(now + command_flight_ns_ + kModelStepNs - 1);
  const ModelStep acts = step + timeline_.lag();
  const bool as_paper = fresh != nullptr && (acts - timeline_.last_sample_step() <= kPaperSteps ||
                                             !lag_estimator_.model_is_right());
  const auto integration = new_sample_ && !commanded_ ? Integration::kOn : Integration::kFrozen;
  if (as_paper) {
    last_command_ = law_.Step(*fresh, reference, integration);
  } else {
    const float ahead_s = kModelStep_s * static_cast<float>(acts - period_step_);
    last_command_ = law_.Step(ToSensors(timeline_.At(acts)), Ahead(reference, ahead_s), integration);
  }
  new_sample_ = false;
  commanded_ = true;
  timeline_.Command(step, last_command_);
  return last_command_;
}

}  // namespace tiltproof::firmware
