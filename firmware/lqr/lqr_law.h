// The control law of the build `lqr`: a discrete linear-quadratic regulator with integral action for any vehicle, with
// or without hinges, at any heading.
//
//   LqrLaw law(table);
//   law.Step(sensed, reference, command);   // once per period
//
//   u = u_hover - K (x - x_ref), each input limited to its range
//
//   sensed  x y z, roll pitch yaw, alpha of each hinge, and the rates of all these in the same order
//   x       sensed, and the integrals of the errors of x, y, z and yaw
//
// K holds for a heading of 0. So the law turns the errors of position and velocity, and the integrals, from the world
// into the heading frame: z up, x along the sensed heading. The integrals themselves are kept in the world frame, where
// wind is constant. The yaw error is wrapped to half a turn.
//
// The law differs from a linear one in three places, all for large errors: the errors of position and yaw are limited;
// the inputs are limited; the integrals wait while an input is at its limit.
//
// Arithmetic is binary32, in a fixed order. No heap, no call of the C library.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "firmware/signals.h"

namespace tiltproof::firmware {

inline constexpr std::size_t kLqrRotorsMax = 8, kLqrHingesMax = 8;
inline constexpr std::size_t kLqrInputsMax = kLqrRotorsMax + kLqrHingesMax;
inline constexpr std::size_t kLqrSensedMax = 2 * (6 + kLqrHingesMax);
inline constexpr std::size_t kLqrIntegralCount = 4;
inline constexpr std::size_t kLqrColumnsMax = kLqrSensedMax + kLqrIntegralCount;

// Numbers of one vehicle. Sizes follow from the counts.
struct LqrTable {
  std::size_t hinge_count = 0, input_count = 0;  // rotors and hinges are inputs
  float period_s = 0.012F;
  bool rates_in_world = true;  // the sensed angular rates are about the world's axes; otherwise the body's
  std::array<float, kLqrSensedMax> hover_state{};
  std::array<float, kLqrInputsMax> hover_input{}, input_min{}, input_max{};
  std::array<std::array<float, kLqrColumnsMax>, kLqrInputsMax> gain{};

  std::size_t sensed_count() const { return 2 * (6 + hinge_count); }
};

class LqrLaw {
 public:
  // `table` must outlive the law.
  explicit LqrLaw(const LqrTable& table) : table_(table) {}

  // `sensed` has table.sensed_count() finite numbers, and `command` table.input_count.
  void Step(std::span<const float> sensed, const Reference& reference, std::span<float> command);

 private:
  using Integrals = std::array<float, kLqrIntegralCount>;
  // Errors of x, y, z in the world and of yaw, limited.
  static Integrals ErrorsOf(std::span<const float> sensed, const Reference& reference);

  const LqrTable& table_;
  Integrals integrals_{};        // m s and rad s
  Integrals previous_errors_{};  // of the last step
  bool limited_ = false;         // an input of the last step was at its limit
};

}  // namespace tiltproof::firmware
