// The paper's control law and spiral in double precision, written only from the paper: the product's flights
// are compared with it.
//
//   ReferenceController controller(ReadGainCsv(file), {10.2751, 10.2799, 0, 0});
//   ActuatorsTruth u = controller.Step(plant.State(), Spiral(t, /*velocity=*/true));   // once each 12 ms
#pragma once

#include <array>
#include <filesystem>

#include "firmware/signals.h"

namespace tiltproof::testing {

// Rows f_r, f_l, tau_r, tau_l; columns: q (8), q_dot (8), integrals of the errors of x, y, z, yaw.
using ReferenceGain = std::array<std::array<double, 20>, 4>;

// Four lines of 20 comma-separated numbers. Throws std::runtime_error.
ReferenceGain ReadGainCsv(const std::filesystem::path& file);

// u = u_eq - K (x - x_ref), trapezoidal integrals that include the present error; the error before the first
// step counts as zero.
class ReferenceController {
 public:
  ReferenceController(const ReferenceGain& gain, const ActuatorsTruth& feed_forward)
      : gain_(gain), feed_forward_(feed_forward) {}

  ActuatorsTruth Step(const SensorsTruth& sensed, const ReferenceTruth& reference);

 private:
  static constexpr double kPeriod_s = 0.012;
  ReferenceGain gain_;
  ActuatorsTruth feed_forward_;
  std::array<double, 4> integrals_{}, previous_errors_{};
};

// Paper, eq. (1) with n = 3, T_f = 60 s, d = 5 m, h = 10 m, start (2, 0, 0.5) m; velocities 0 unless asked
// for.
ReferenceTruth Spiral(double t_s, bool velocity);

}  // namespace tiltproof::testing
