// The first reply of a board that was reset while another one flew.
#include <gtest/gtest.h>

#include "firmware/builds.h"
#include "firmware/messages.h"
#include "firmware/tolerant/tolerant_control.h"

namespace tiltproof::firmware {
namespace {

// The vehicle does not follow the first command, because another board commands it. The second reply is the answer to the
// second request, and not to the first one.
TEST(FirstReplyTest, TheSecondReplyOfAVehicleThatDidNotFollowIsAnswered) {
  const Build& build = *FindBuild("tolerant");
  for (const TimeNs delay_ms : {1, 3, 5, 7}) {
    TolerantControl control(*build.gain, build.feed_forward);
    for (int period = 0; period < 2; ++period) {
      const TimeNs begin = period * kControlPeriodNs;
      control.NoteRequest({.origin_ns = 0, .begin_ns = begin, .sent_ns = begin});
      Sensors sensors = {
          .z_m = 1, .pitch_rad = -0.011689F, .alpha_r_rad = 0.011673F, .alpha_l_rad = 0.011615F};
      sensors.x_m = 1e-6F * static_cast<float>(period);  // no repetition
      EXPECT_TRUE(control.OnReply(begin + delay_ms * kNsPerMs, sensors, {.x_m = 5, .y_m = 5, .z_m = 6}))
          << "reply " << period << " after " << delay_ms << " ms";
    }
  }
}

}  // namespace
}  // namespace tiltproof::firmware
