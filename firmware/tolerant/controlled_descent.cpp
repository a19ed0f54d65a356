#include "firmware/tolerant/controlled_descent.h"

#include <algorithm>

#include "firmware/control_law.h"

namespace tiltproof::firmware {
namespace {

constexpr float kPeriod_s = static_cast<float>(ToSeconds(kControlPeriodNs));
// Half a second more with too little thrust than with enough.
constexpr int kShortPeriods = 42;
// 2 s farther from the path than any flight that is survived.
constexpr float kFar_m = 1.5F;
constexpr int kFarPeriods = 167;
constexpr float kBraking_s = 1.5F;

}  // namespace

void ControlledDescent::Watch(const Sensors& sensors, const Reference& reference, bool weak,
                              bool short_of_thrust) {
  if (begun_) return;
  const float x_m = sensors.x_m - reference.x_m;
  const float y_m = sensors.y_m - reference.y_m;
  const float z_m = sensors.z_m - reference.z_m;
  const bool far = x_m * x_m + y_m * y_m + z_m * z_m > kFar_m * kFar_m;
  short_periods_ = weak ? std::max(short_periods_ + (short_of_thrust ? 1 : -1), 0) : 0;
  far_periods_ = weak && far ? far_periods_ + 1 : 0;
  if (short_periods_ < kShortPeriods && far_periods_ < kFarPeriods) return;
  begun_ = true;
  reference_ = {.x_m = sensors.x_m,
                .y_m = sensors.y_m,
                .z_m = sensors.z_m,
                .yaw_rad = sensors.yaw_rad,
                .vx_m_s = sensors.vx_m_s,
                .vy_m_s = sensors.vy_m_s,
                .vz_m_s = sensors.vz_m_s};
}

void ControlledDescent::BeginPeriod() {
  if (!begun_) return;
  constexpr float kShare = kPeriod_s / kBraking_s;
  reference_.vx_m_s -= kShare * reference_.vx_m_s;
  reference_.vy_m_s -= kShare * reference_.vy_m_s;
  reference_.vz_m_s -= kShare * (reference_.vz_m_s + kSink_m_s);
  reference_.x_m += kPeriod_s * reference_.vx_m_s;
  reference_.y_m += kPeriod_s * reference_.vy_m_s;
  reference_.z_m += kPeriod_s * reference_.vz_m_s;
}

}  // namespace tiltproof::firmware
