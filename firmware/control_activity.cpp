#include "firmware/control_activity.h"

namespace tiltproof::firmware {

std::optional<ActuatorCommand> ControlActivity::Do(const ControlItem& item) {
  if (item.kind == ControlItem::Kind::kNoSensors) return std::nullopt;
  if (item.kind == ControlItem::Kind::kTimeout) return ActuatorCommand{.repeats = true, .actuators = {}};
  const Sensors& sensed = item.sensors;
  if (!reference_) {
    reference_ = Reference{.x_m = sensed.x_m,
                           .y_m = sensed.y_m,
                           .z_m = sensed.z_m,
                           .yaw_rad = sensed.yaw_rad,
                           .vx_m_s = 0,
                           .vy_m_s = 0,
                           .vz_m_s = 0};
  }
  return ActuatorCommand{.repeats = false, .actuators = law_.Step(sensed, *reference_)};
}

}  // namespace tiltproof::firmware
