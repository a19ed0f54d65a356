#include "tests/support/reference_controller.h"

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>

namespace tiltproof::testing {

ReferenceGain ReadGainCsv(const std::filesystem::path& file) {
  std::ifstream in(file);
  ReferenceGain gain{};
  std::string line, number;
  for (auto& row : gain) {
    if (!std::getline(in, line)) throw std::runtime_error(file.string() + ": fewer than four lines");
    std::istringstream fields(line);
    for (double& element : row) {
      if (!std::getline(fields, number, ','))
        throw std::runtime_error(file.string() + ": fewer than 20 numbers");
      element = std::stod(number);
    }
    if (std::getline(fields, number, ',')) throw std::runtime_error(file.string() + ": more than 20 numbers");
  }
  if (std::getline(in, line)) throw std::runtime_error(file.string() + ": more than four lines");
  return gain;
}

ActuatorsTruth ReferenceController::Step(const SensorsTruth& s, const ReferenceTruth& r) {
  const std::array<double, 4> errors = {s.x_m - r.x_m, s.y_m - r.y_m, s.z_m - r.z_m, s.yaw_rad - r.yaw_rad};
  for (std::size_t i = 0; i < errors.size(); ++i) {
    integrals_[i] += 0.5 * kPeriod_s * (errors[i] + previous_errors_[i]);
  }
  previous_errors_ = errors;
  const std::array<double, 20> deviation = {
      errors[0],           errors[1],     errors[2],     s.roll_rad,          s.pitch_rad,
      errors[3],           s.alpha_r_rad, s.alpha_l_rad, s.vx_m_s - r.vx_m_s, s.vy_m_s - r.vy_m_s,
      s.vz_m_s - r.vz_m_s, s.wx_rad_s,    s.wy_rad_s,    s.wz_rad_s,          s.alpha_r_rad_s,
      s.alpha_l_rad_s,     integrals_[0], integrals_[1], integrals_[2],       integrals_[3]};
  std::array<double, 4> u = {feed_forward_.f_r_n, feed_forward_.f_l_n, feed_forward_.tau_r_nm,
                             feed_forward_.tau_l_nm};
  for (std::size_t row = 0; row < u.size(); ++row) {
    for (std::size_t column = 0; column < deviation.size(); ++column)
      u[row] -= gain_[row][column] * deviation[column];
  }
  return {u[0], u[1], u[2], u[3]};
}

ReferenceTruth Spiral(double t_s, bool velocity) {
  constexpr double turns = 3, duration_s = 60, radius_m = 5, height_m = 10;
  const double w = 2 * turns * std::numbers::pi / duration_s;
  ReferenceTruth r;
  r.x_m = radius_m * std::cos(w * t_s) - radius_m + 2;
  r.y_m = radius_m * std::sin(w * t_s);
  r.z_m = height_m * t_s / duration_s + 0.5;
  if (velocity) {
    r.vx_m_s = -radius_m * w * std::sin(w * t_s);
    r.vy_m_s = radius_m * w * std::cos(w * t_s);
    r.vz_m_s = height_m / duration_s;
  }
  return r;
}

}  // namespace tiltproof::testing
