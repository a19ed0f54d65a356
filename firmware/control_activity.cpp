#include "firmware/control_activity.h"

#include "firmware/messages.h"

namespace tiltproof::firmware {

ControlActivity::ControlActivity(const Build& build) : law_(*build.gain, build.feed_forward) {
  if (build.late_replies == LateReplies::kKept) tolerant_.emplace(*build.gain, build.feed_forward);
}

void ControlActivity::Follow(const Reference& reference) {
  reference_ = reference;
  if (!tolerant_) return;
  // Before the first reply nothing flies yet.
  if (!follower_ || tolerant_->status().state == SupervisorState::kInit) follower_.emplace(reference);
  follower_->Receive(reference);
}

std::optional<Actuators> ControlActivity::Do(const ControlItem& item) {
  const Sensors& sensed = item.sensors;
  if (item.kind == ControlItem::Kind::kSensors && !reference_ && (!tolerant_ || link::IsPlausible(sensed))) {
    reference_ = Reference{.x_m = sensed.x_m,
                           .y_m = sensed.y_m,
                           .z_m = sensed.z_m,
                           .yaw_rad = sensed.yaw_rad,
                           .vx_m_s = 0,
                           .vy_m_s = 0,
                           .vz_m_s = 0};
    if (tolerant_) follower_.emplace(*reference_);
  }
  if (tolerant_) return DoTolerantly(item);
  if (item.kind != ControlItem::Kind::kSensors) return std::nullopt;
  return law_.Step(sensed, *reference_);
}

std::optional<Actuators> ControlActivity::DoTolerantly(const ControlItem& item) {
  std::optional<Actuators> actuators;
  switch (item.kind) {
    case ControlItem::Kind::kRequest:
      tolerant_->NoteRequest(item.request);
      if (!follower_) break;
      follower_->BeginPeriod();
      tolerant_->NoteReference(follower_->follows());
      break;
    case ControlItem::Kind::kSensors:
      if (follower_) actuators = tolerant_->OnReply(item.time_ns, item.sensors, follower_->Flown());
      break;
    case ControlItem::Kind::kTimeout:
      if (follower_) actuators = tolerant_->OnTimeout(item.time_ns, follower_->Flown());
      break;
    case ControlItem::Kind::kBlind:
      tolerant_->NoteBlind();
      break;
    case ControlItem::Kind::kNoSensors:
      break;
  }
  return actuators;
}

}  // namespace tiltproof::firmware
