#include "firmware/tolerant/innovation.h"

#include <algorithm>

namespace tiltproof::firmware {
namespace {

constexpr Innovation kSpreadFloor = {1e-3F, 1e-3F, 1e-3F,  // m
                                     2e-3F, 2e-3F, 2e-3F,  // rad
                                     2e-3F, 2e-3F,         // rad
                                     1e-2F, 1e-2F, 1e-2F,  // m/s
                                     3e-2F, 6e-2F, 3e-2F,  // rad/s; the smallest inertia is that of pitch
                                     0.1F,  0.1F};         // rad/s
constexpr float kSpreadOfChange = 0.1F;

}  // namespace

Innovation Compare(const MotionState& sample, const MotionState& predicted) {
  const Vector3 position = sample.p_WC_m - predicted.p_WC_m;
  // Small rotation from one to the other.
  const Vector3 turn =
      0.5F * (Cross(predicted.R_WB.x, sample.R_WB.x) + Cross(predicted.R_WB.y, sample.R_WB.y) +
              Cross(predicted.R_WB.z, sample.R_WB.z));
  const Vector3 velocity = sample.v_WC_m_s - predicted.v_WC_m_s;
  const Vector3 rate = sample.w_WB_rad_s - predicted.w_WB_rad_s;
  return {position.x,
          position.y,
          position.z,
          turn.x,
          turn.y,
          turn.z,
          sample.alpha_rad[0] - predicted.alpha_rad[0],
          sample.alpha_rad[1] - predicted.alpha_rad[1],
          velocity.x,
          velocity.y,
          velocity.z,
          rate.x,
          rate.y,
          rate.z,
          sample.alpha_rad_s[0] - predicted.alpha_rad_s[0],
          sample.alpha_rad_s[1] - predicted.alpha_rad_s[1]};
}

Innovation ExpectedVariance(const MotionState& sample, const MotionState& previous_sample) {
  Innovation variance = Compare(sample, previous_sample);
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    const float spread = kSpreadOfChange * variance[i];
    variance[i] = kSpreadFloor[i] * kSpreadFloor[i] + spread * spread;
  }
  return variance;
}

float Misfit(const MotionState& sample, const MotionState& predicted, const MotionState& previous_sample) {
  const Innovation difference = Compare(sample, predicted);
  const Innovation variance = ExpectedVariance(sample, previous_sample);
  float sum = 0;
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    // In this order, what is no number agrees with nothing.
    sum += std::min(kSignalMisfitMax, difference[i] * difference[i] / variance[i]);
  }
  return sum;
}

}  // namespace tiltproof::firmware
