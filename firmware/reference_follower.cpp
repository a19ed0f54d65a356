#include "firmware/reference_follower.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "firmware/control_law.h"
#include "firmware/trigonometry.h"

namespace tiltproof::firmware {
namespace {

constexpr float kReferencePeriod_s = static_cast<float>(ToSeconds(kControlPeriodNs));

// Largest rates at which a reference moves beside its velocity; position references have no velocity.
constexpr float kSpeedMax_m_s = 5;
constexpr float kYawRateMax_rad_s = 3;
// The velocity itself may jump, at corners of a path; beyond is damage.
constexpr float kVelocityJumpMax_m_s = 5;
// References in a row that must agree before a jump is believed.
constexpr std::int32_t kAgreeing = 4;
// After a jump.
constexpr float kApproach_m_s = 1;
constexpr float kApproach_rad_s = 0.5F;
// One reference per period, which comes in any order with the reply: this old is still the newest.
constexpr std::int32_t kFreshPeriods = 2;
// 1.2 s along a straight line: at 1 m/s^2 across, 0.7 m beside a path that turns.
constexpr std::int32_t kExtrapolatedPeriods = 100;

Reference Along(Reference reference, std::int32_t periods) {
  const float time_s = kReferencePeriod_s * static_cast<float>(periods);
  reference.x_m += time_s * reference.vx_m_s;
  reference.y_m += time_s * reference.vy_m_s;
  reference.z_m += time_s * reference.vz_m_s;
  return reference;
}

// From b to a, the short way: pi and -pi are one heading.
float YawBetween(const Reference& a, const Reference& b) {
  return WrapAngle(WrapAngle(a.yaw_rad) - WrapAngle(b.yaw_rad));
}

bool IsNear(const Reference& a, const Reference& b, std::int32_t periods) {
  const float time_s = kReferencePeriod_s * static_cast<float>(std::max(periods, std::int32_t{1}));
  const auto within = [](float x, float y, float limit) { return std::abs(x - y) <= limit; };
  return within(a.x_m, b.x_m, kSpeedMax_m_s * time_s) && within(a.y_m, b.y_m, kSpeedMax_m_s * time_s) &&
         within(a.z_m, b.z_m, kSpeedMax_m_s * time_s) &&
         std::abs(YawBetween(a, b)) <= kYawRateMax_rad_s * time_s &&
         within(a.vx_m_s, b.vx_m_s, kVelocityJumpMax_m_s) &&
         within(a.vy_m_s, b.vy_m_s, kVelocityJumpMax_m_s) && within(a.vz_m_s, b.vz_m_s, kVelocityJumpMax_m_s);
}

void Shrink(float& value, float step) { value -= std::clamp(value, -step, step); }

}  // namespace

void ReferenceFollower::BeginPeriod() {
  accepted_age_ = std::min(accepted_age_ + 1, std::int32_t{10'000});
  candidate_age_ = std::min(candidate_age_ + 1, std::int32_t{10'000});
  if (!approaching_) return;
  Shrink(offset_.x_m, kApproach_m_s * kReferencePeriod_s);
  Shrink(offset_.y_m, kApproach_m_s * kReferencePeriod_s);
  Shrink(offset_.z_m, kApproach_m_s * kReferencePeriod_s);
  Shrink(offset_.yaw_rad, kApproach_rad_s * kReferencePeriod_s);
  approaching_ = offset_.x_m != 0 || offset_.y_m != 0 || offset_.z_m != 0 || offset_.yaw_rad != 0;
}

void ReferenceFollower::Receive(const Reference& reference) {
  if (any_received_ && !IsNear(reference, Extrapolated(), accepted_age_)) {
    const bool agrees =
        candidate_count_ > 0 && IsNear(reference, Along(candidate_, candidate_age_), candidate_age_);
    candidate_count_ = agrees ? candidate_count_ + 1 : 1;
    candidate_ = reference;
    candidate_age_ = 0;
    if (candidate_count_ < kAgreeing) return;
    const Reference flown = Flown();
    offset_ = {.x_m = flown.x_m - reference.x_m,
               .y_m = flown.y_m - reference.y_m,
               .z_m = flown.z_m - reference.z_m,
               .yaw_rad = YawBetween(flown, reference)};
    approaching_ = true;
  }
  any_received_ = true;
  candidate_count_ = 0;
  accepted_ = reference;
  accepted_age_ = 0;
}

bool ReferenceFollower::Late() const { return any_received_ && accepted_age_ > kFreshPeriods; }

Reference ReferenceFollower::Extrapolated() const {
  if (!Late()) return accepted_;
  Reference moved = Along(accepted_, std::min(accepted_age_ - 1, kExtrapolatedPeriods));
  if (accepted_age_ > kExtrapolatedPeriods) moved.vx_m_s = moved.vy_m_s = moved.vz_m_s = 0;
  return moved;
}

Reference ReferenceFollower::Flown() const {
  Reference flown = Extrapolated();
  if (!approaching_) return flown;
  flown.x_m += offset_.x_m;
  flown.y_m += offset_.y_m;
  flown.z_m += offset_.z_m;
  flown.yaw_rad += offset_.yaw_rad;
  return flown;
}

}  // namespace tiltproof::firmware
