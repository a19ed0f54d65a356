// A reply whose values are plausible one by one, and together those of no vehicle, as damage that the checksum lets
// through can make it: found by tests/fuzz/firmware_fuzz.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "firmware/builds.h"
#include "firmware/messages.h"
#include "firmware/tolerant/tolerant_control.h"
#include "firmware/tolerant/vehicle_parameters.h"

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

// The server refuses a command that no vehicle can carry out, and then the vehicle flies on with the last one. Absurd
// replies and silence in any order: each value is one that a message may have, or none.
TEST(AbsurdReplyTest, CommandsStayWithinWhatTheActuatorsHave) {
  const Build& build = *FindBuild("tolerant");
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    std::mt19937 engine(seed);
    const auto draw = [&engine] { return static_cast<float>(engine()) * 0x1p-31F - 1; };  // -1 to 1
    TolerantControl control(*build.gain, build.feed_forward);
    for (int period = 0; period < 60; ++period) {
      const TimeNs begin = period * kControlPeriodNs;
      control.NoteRequest({.origin_ns = 0, .begin_ns = begin, .sent_ns = begin});
      Sensors sensors = kHovering;
      const bool absurd = draw() < 0;
      for (const auto& field : kSensorFields) {
        if (!absurd || draw() < 0.5F) continue;
        const float limit = field.column.ends_with("_rad_s") ? link::kAngularRateMax_rad_s
                            : field.column.ends_with("_rad") ? link::kAngleMax_rad
                            : field.column.ends_with("_m_s") ? link::kVelocityMax_m_s
                                                             : link::kPositionMax_m;
        // An implausible value arrives as NaN: DecodeSensorsPartly().
        sensors.*field.in_float = draw() < -0.8F ? std::numeric_limits<float>::quiet_NaN() : limit * draw();
      }
      const auto command = draw() < 0 ? control.OnReply(begin + kNsPerMs, sensors, {.z_m = 1})
                                      : control.OnTimeout(begin + build.reply_timeout_ns, {.z_m = 1});
      if (!command) continue;
      for (const float thrust_n : {command->f_r_n, command->f_l_n})
        ASSERT_TRUE(thrust_n >= 0 && thrust_n <= kTiltrotorConstants.force_max_n)
            << thrust_n << " N in period " << period << ", seed " << seed;
      for (const float torque_nm : {command->tau_r_nm, command->tau_l_nm})
        ASSERT_TRUE(std::abs(torque_nm) <= kTiltrotorConstants.torque_max_nm)
            << torque_nm << " N m in period " << period << ", seed " << seed;
    }
  }
}

}  // namespace
}  // namespace tiltproof::firmware
