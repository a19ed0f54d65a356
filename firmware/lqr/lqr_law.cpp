#include "firmware/lqr/lqr_law.h"

#include "firmware/trigonometry.h"

namespace tiltproof::firmware {
namespace {

// About 20 degrees of tilt with the default weights. A larger error would tip the vehicle over.
constexpr float kPositionErrorMax_m = 1.0F;
constexpr float kYawErrorMax_rad = 0.5F;

constexpr std::size_t kYaw = 5, kFirstHinge = 6;

float Limited(float value, float low, float high) {
  if (value > high) return high;
  if (value < low) return low;
  return value;
}

// A vector along x and y of the world, along forward and left of the heading.
struct Level {
  float forward, left;
};
Level Turned(const SineCosine& yaw, float x, float y) {
  return {yaw.cosine * x + yaw.sine * y, yaw.cosine * y - yaw.sine * x};
}

}  // namespace

LqrLaw::Integrals LqrLaw::ErrorsOf(std::span<const float> sensed, const Reference& reference) {
  float x = sensed[0] - reference.x_m, y = sensed[1] - reference.y_m;
  // The direction stays, so that the way back is straight at every heading.
  const float distance_m = __builtin_sqrtf(x * x + y * y);
  if (distance_m > kPositionErrorMax_m) {
    x *= kPositionErrorMax_m / distance_m;
    y *= kPositionErrorMax_m / distance_m;
  }
  const float yaw = WrapAngle(WrapAngle(sensed[kYaw]) - WrapAngle(reference.yaw_rad));
  return {x, y, Limited(sensed[2] - reference.z_m, -kPositionErrorMax_m, kPositionErrorMax_m),
          Limited(yaw, -kYawErrorMax_rad, kYawErrorMax_rad)};
}

void LqrLaw::Step(std::span<const float> sensed, const Reference& reference, std::span<float> command) {
  const std::size_t coordinates = kFirstHinge + table_.hinge_count, states = 2 * coordinates;
  const Integrals errors = ErrorsOf(sensed, reference);
  for (std::size_t i = 0; i < kLqrIntegralCount && !limited_; ++i)
    integrals_[i] += 0.5F * table_.period_s * (errors[i] + previous_errors_[i]);
  previous_errors_ = errors;

  std::array<float, kLqrColumnsMax> x{};
  for (std::size_t i = 0; i < states; ++i) x[i] = sensed[i] - table_.hover_state[i];
  const SineCosine yaw = ComputeSineCosine(WrapAngle(sensed[kYaw]));
  const auto put = [&](std::size_t at, float along_x, float along_y) {
    const Level level = Turned(yaw, along_x, along_y);
    x[at] = level.forward;
    x[at + 1] = level.left;
  };
  put(0, errors[0], errors[1]);
  x[2] = errors[2];
  x[kYaw] = errors[3];
  const std::size_t velocity = coordinates, rates = coordinates + 3;
  put(velocity, sensed[velocity] - reference.vx_m_s, sensed[velocity + 1] - reference.vy_m_s);
  x[velocity + 2] = sensed[velocity + 2] - reference.vz_m_s;
  if (table_.rates_in_world) put(rates, sensed[rates], sensed[rates + 1]);
  put(states, integrals_[0], integrals_[1]);
  x[states + 2] = integrals_[2];
  x[states + 3] = integrals_[3];

  limited_ = false;
  for (std::size_t input = 0; input < table_.input_count; ++input) {
    float sum = 0;
    for (std::size_t column = 0; column < states + kLqrIntegralCount; ++column)
      sum += table_.gain[input][column] * x[column];
    const float wanted = table_.hover_input[input] - sum;
    command[input] = Limited(wanted, table_.input_min[input], table_.input_max[input]);
    limited_ = limited_ || command[input] != wanted;
  }
}

}  // namespace tiltproof::firmware
