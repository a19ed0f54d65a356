#include "firmware/trigonometry.h"

#include <cstdint>

namespace tiltproof::firmware {
namespace {

// pi/2 in three parts: the first two have few bits, so that they times a small integer are exact.
constexpr float kHalfPiHigh = 1.5703125F;
constexpr float kHalfPiMiddle = 4.837512969970703125e-4F;
constexpr float kHalfPiLow = 7.549789954891882e-8F;
constexpr float kTwoOverPi = 0.636619772367581F;

// Not NaN, and no number so large that an angle has no meaning.
bool IsOrdinary(float value) {
  constexpr float kBeyond = 1e5F;
  return value > -kBeyond && value < kBeyond;
}

// 0 for what is no angle.
std::int32_t Nearest(float value) {
  if (!IsOrdinary(value)) return 0;
  return static_cast<std::int32_t>(value < 0 ? value - 0.5F : value + 0.5F);
}

// Sine and cosine of an angle in [-pi/4, pi/4].
float SmallSine(float x) {
  const float z = x * x;
  return ((-1.9515295891e-4F * z + 8.3321608736e-3F) * z - 1.6666654611e-1F) * z * x + x;
}
float SmallCosine(float x) {
  const float z = x * x;
  return ((2.443315711809948e-5F * z - 1.388731625493765e-3F) * z + 4.166664568298827e-2F) * z * z -
         0.5F * z + 1.0F;
}

// Arc tangent of a ratio in [0, 1].
float SmallArcTangent(float ratio) {
  constexpr float kTangentOfEighth = 0.4142135623730950F;  // tan(pi/8)
  const bool shifted = ratio > kTangentOfEighth;
  const float x = shifted ? (ratio - 1) / (ratio + 1) : ratio;
  const float z = x * x;
  const float series =
      (((8.05374449538e-2F * z - 1.38776856032e-1F) * z + 1.99777106478e-1F) * z - 3.33329491539e-1F) * z *
          x +
      x;
  return shifted ? kPi / 4 + series : series;
}

}  // namespace

SineCosine ComputeSineCosine(float angle_rad) {
  const std::int32_t quarter = Nearest(angle_rad * kTwoOverPi);
  const auto turns = static_cast<float>(quarter);
  const float rest_rad = ((angle_rad - turns * kHalfPiHigh) - turns * kHalfPiMiddle) - turns * kHalfPiLow;
  const float sine = SmallSine(rest_rad);
  const float cosine = SmallCosine(rest_rad);
  switch (static_cast<std::uint32_t>(quarter) & 3U) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

float ArcTangent(float y, float x) {
  const float y_size = y < 0 ? -y : y;
  const float x_size = x < 0 ? -x : x;
  if (x_size == 0 && y_size == 0) return 0;
  float angle_rad =
      y_size <= x_size ? SmallArcTangent(y_size / x_size) : kPi / 2 - SmallArcTangent(x_size / y_size);
  if (x < 0) angle_rad = kPi - angle_rad;
  return y < 0 ? -angle_rad : angle_rad;
}

float WrapAngle(float angle_rad) {
  if (!IsOrdinary(angle_rad)) return 0;
  while (angle_rad > kPi) angle_rad -= 2 * kPi;
  while (angle_rad <= -kPi) angle_rad += 2 * kPi;
  return angle_rad;
}

}  // namespace tiltproof::firmware
