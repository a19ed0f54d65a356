#include "firmware/control_law.h"

namespace tiltproof::firmware {
namespace {

constexpr float kHalfPeriod_s = 0.5F * static_cast<float>(ToSeconds(kControlPeriodNs));

}  // namespace

ControlLaw::ControlLaw(const Gain& gain, const Actuators& feed_forward)
    : gain_(gain), feed_forward_(feed_forward) {}

Actuators ControlLaw::Step(const Sensors& sensors, const Reference& reference, Integration integration) {
  const std::array<float, kIntegralCount> regulated_errors = {
      sensors.x_m - reference.x_m, sensors.y_m - reference.y_m, sensors.z_m - reference.z_m,
      sensors.yaw_rad - reference.yaw_rad};
  for (std::size_t i = 0; i < kIntegralCount && integration == Integration::kOn; ++i) {
    integrals_[i] += kHalfPeriod_s * (regulated_errors[i] + previous_errors_[i]);
  }
  previous_errors_ = regulated_errors;

  const std::array<float, kStateCount> state_error = {regulated_errors[0],
                                                      regulated_errors[1],
                                                      regulated_errors[2],
                                                      sensors.roll_rad,
                                                      sensors.pitch_rad,
                                                      regulated_errors[3],
                                                      sensors.alpha_r_rad,
                                                      sensors.alpha_l_rad,
                                                      sensors.vx_m_s - reference.vx_m_s,
                                                      sensors.vy_m_s - reference.vy_m_s,
                                                      sensors.vz_m_s - reference.vz_m_s,
                                                      sensors.wx_rad_s,
                                                      sensors.wy_rad_s,
                                                      sensors.wz_rad_s,
                                                      sensors.alpha_r_rad_s,
                                                      sensors.alpha_l_rad_s,
                                                      integrals_[0],
                                                      integrals_[1],
                                                      integrals_[2],
                                                      integrals_[3]};

  // The four rows side by side: their sums do not wait for each other, and the order within each is that of
  // the columns.
  float f_r_n = 0;
  float f_l_n = 0;
  float tau_r_nm = 0;
  float tau_l_nm = 0;
  for (std::size_t column = 0; column < kStateCount; ++column) {
    f_r_n += gain_[0][column] * state_error[column];
    f_l_n += gain_[1][column] * state_error[column];
    tau_r_nm += gain_[2][column] * state_error[column];
    tau_l_nm += gain_[3][column] * state_error[column];
  }
  return {.f_r_n = feed_forward_.f_r_n - f_r_n,
          .f_l_n = feed_forward_.f_l_n - f_l_n,
          .tau_r_nm = feed_forward_.tau_r_nm - tau_r_nm,
          .tau_l_nm = feed_forward_.tau_l_nm - tau_l_nm};
}

}  // namespace tiltproof::firmware
