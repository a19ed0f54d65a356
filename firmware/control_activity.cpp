#include "firmware/control_activity.h"

namespace tiltproof::firmware {

ControlActivity::ControlActivity(const Build& build) : law_(*build.gain, build.feed_forward) {
  if (build.late_replies == LateReplies::kKept) tolerant_.emplace(*build.gain, build.feed_forward);
}

std::optional<Actuators> ControlActivity::Do(const ControlItem& item) {
  const Sensors& sensed = item.sensors;
  if (item.kind == ControlItem::Kind::kSensors && !reference_) {
    reference_ = Reference{.x_m = sensed.x_m,
                           .y_m = sensed.y_m,
                           .z_m = sensed.z_m,
                           .yaw_rad = sensed.yaw_rad,
                           .vx_m_s = 0,
                           .vy_m_s = 0,
                           .vz_m_s = 0};
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
      break;
    case ControlItem::Kind::kSensors:
      actuators = tolerant_->OnReply(item.time_ns, item.sensors, *reference_);
      break;
    case ControlItem::Kind::kTimeout:
      if (reference_) actuators = tolerant_->OnTimeout(item.time_ns, *reference_);
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
