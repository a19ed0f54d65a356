// A reply whose values are plausible one by one, and together those of no vehicle, as damage that the checksum lets
// through can make it: found by tests/fuzz/firmware_fuzz.cpp.
#include <gtest/gtest.h>

#include <cmath>

#include "firmware/builds.h"
#include "firmware/tolerant_control.h"
#include "firmware/vehicle_parameters.h"

namespace tiltproof::firmware {
namespace {

constexpr Sensors kHovering = {
    .z_m = 1, .pitch_rad = -0.011689F, .alpha_r_rad = 0.011673F, .alpha_l_rad = 0.011615F};

TEST(AbsurdReplyTest, CommandsStayFiniteAndTheNextRepliesAreFlown) {
  const Build& build = *FindBuild("tolerant");
  TolerantControl control(*build.gain, build.feed_forward);
  Sensors absurd = kHovering;
  absurd.wx_rad_s = absurd.wy_rad_s = 999;
  absurd.wz_rad_s = absurd.alpha_r_rad_s = absurd.alpha_l_rad_s = -999;
  const Reference here = {.z_m = 1};

  Actuators last;
  for (int period = 0; period < 200; ++period) {
    const TimeNs begin = period * kControlPeriodNs;
    control.NoteRequest({.origin_ns = 0, .begin_ns = begin, .sent_ns = begin});
    const bool heard = period == 0 || period >= 40;  // the line is silent between them
    const Sensors& sensors = period == 0 ? absurd : kHovering;
    const auto command = heard ? control.OnReply(begin + kNsPerMs, sensors, here)
                               : control.OnTimeout(begin + build.reply_timeout_ns, here);
    if (command) last = *command;
    for (const auto& field : kActuatorFields)
      ASSERT_TRUE(std::isfinite(last.*field.in_float)) << field.column << " in period " << period;
  }
  EXPECT_NEAR(last.f_r_n, build.feed_forward.f_r_n, 0.5F);
  EXPECT_NEAR(last.f_l_n, build.feed_forward.f_l_n, 0.5F);
}

// The server refuses a command that no vehicle can carry out, and then the vehicle flies on with the last one.
TEST(AbsurdReplyTest, CommandsStayWithinWhatTheActuatorsHave) {
  const Build& build = *FindBuild("tolerant");
  TolerantControl control(*build.gain, build.feed_forward);
  Sensors absurd = kHovering;
  absurd.x_m = absurd.y_m = 9e3F;
  absurd.z_m = absurd.vz_m_s = -900;
  const Reference here = {.z_m = 1};
  for (int period = 0; period < 200; ++period) {
    const TimeNs begin = period * kControlPeriodNs;
    control.NoteRequest({.origin_ns = 0, .begin_ns = begin, .sent_ns = begin});
    const auto command = control.OnReply(begin + kNsPerMs, period == 0 ? absurd : kHovering, here);
    if (!command) continue;
    for (const float thrust_n : {command->f_r_n, command->f_l_n}) {
      ASSERT_GE(thrust_n, 0) << "in period " << period;
      ASSERT_LE(thrust_n, kTiltrotorConstants.force_max_n) << "in period " << period;
    }
    for (const float torque_nm : {command->tau_r_nm, command->tau_l_nm})
      ASSERT_LE(std::abs(torque_nm), kTiltrotorConstants.torque_max_nm) << "in period " << period;
  }
}

}  // namespace
}  // namespace tiltproof::firmware
