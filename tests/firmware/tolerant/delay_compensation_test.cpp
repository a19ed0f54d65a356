// Estimates of the instant that a reply shows, and of the lag of commands. The firmware's own model of motion
// makes the streams of replies, so that the right answer is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <random>

#include "firmware/builds.h"
#include "firmware/tolerant/accepted_replies.h"
#include "firmware/tolerant/innovation.h"
#include "firmware/tolerant/lag_estimator.h"
#include "firmware/tolerant/motion_timeline.h"
#include "firmware/tolerant/reply_matcher.h"
#include "firmware/tolerant/tolerant_control.h"
#include "tests/firmware/ordinary_noise.h"

namespace tiltproof::firmware {
namespace {

constexpr Actuators kHoverInputs = {.f_r_n = 10.2712F, .f_l_n = 10.2804F, .tau_r_nm = 0, .tau_l_nm = 0};
constexpr Sensors kMoving = {.z_m = 1,
                             .pitch_rad = -0.011689F,
                             .alpha_r_rad = 0.011673F,
                             .alpha_l_rad = 0.011615F,
                             .vx_m_s = 1.5F,
                             .vy_m_s = 0.5F};

TimeNs TimeOf(ModelStep step) { return step * kModelStepNs; }

// Commands as a controller sends them: each period another.
Actuators CommandOf(ModelStep step) {
  const auto n = static_cast<float>(step / 3 % 7 - 3);
  return {.f_r_n = kHoverInputs.f_r_n + 0.25F * n,
          .f_l_n = kHoverInputs.f_l_n - 0.15F * n,
          .tau_r_nm = 5e-3F * n,
          .tau_l_nm = 2e-3F * n * n - 8e-3F};
}

// The vehicle, with commands in force `lag` steps late.
class Truth {
 public:
  explicit Truth(ModelStep lag) : lag_(lag), state_(ToMotion(kMoving)) {}

  MotionState At(ModelStep step) {
    for (; step_ < step; ++step_) {
      const ModelStep sent = step_ - lag_;
      StepMotion(kTiltrotorConstants, sent < 1 ? kHoverInputs : CommandOf((sent - 1) / 3 * 3), state_);
    }
    return state_;
  }

 private:
  ModelStep lag_;
  ModelStep step_ = 0;
  MotionState state_;
};

TEST(MotionTimelineTest, PredictsWhatTheVehicleDoesUnderTheCommands) {
  for (const ModelStep lag : {0, 1, 5, 12}) {
    Truth truth(lag);
    MotionTimeline timeline;
    timeline.Begin(0, truth.At(0), kHoverInputs);
    timeline.SetLag(lag);
    for (ModelStep step = 0; step < 30; step += 3) timeline.Command(step + 1, CommandOf(step));
    EXPECT_EQ(timeline.At(30), truth.At(30)) << lag;
    EXPECT_EQ(timeline.Suppose(30, lag), truth.At(30)) << lag;
  }
}

TEST(MotionTimelineTest, ALaterCommandChangesOnlyWhatIsAfterIt) {
  MotionTimeline timeline;
  timeline.Begin(0, ToMotion(kMoving), kHoverInputs);
  const MotionState before = timeline.At(10);
  const MotionState after = timeline.At(12);
  timeline.Command(10, CommandOf(3));
  EXPECT_EQ(timeline.At(10), before);
  EXPECT_NE(timeline.At(12), after);
}

TEST(ReplyMatcherTest, TellsALateReplyByItsContent) {
  for (const int late_periods : {0, 1, 2, 4}) {
    Truth truth(0);
    MotionTimeline timeline;
    ReplyMatcher matcher;
    timeline.Begin(0, truth.At(0), kHoverInputs);
    for (ModelStep step = 3; step < 60; step += 3) {
      timeline.Command(step - 2, CommandOf(step - 3));
      matcher.Request(step, TimeOf(step));
      const ModelStep shown = step - 3 * late_periods;
      if (shown < 3) continue;
      const auto match = matcher.Match(Truth(0).At(shown), TimeOf(step) + kNsPerMs, step, timeline);
      ASSERT_TRUE(match);
      EXPECT_EQ(*match, shown) << late_periods;
      EXPECT_EQ(matcher.answers_newest(), late_periods == 0);
      timeline.Correct(*match, Truth(0).At(shown));
    }
  }
}

TEST(ReplyMatcherTest, ALostReplyDoesNotShiftTheOthers) {
  MotionTimeline timeline;
  ReplyMatcher matcher;
  timeline.Begin(0, Truth(0).At(0), kHoverInputs);
  for (ModelStep step = 3; step < 90; step += 3) {
    timeline.Command(step - 2, CommandOf(step - 3));
    matcher.Request(step, TimeOf(step));
    if (step % 4 == 0) continue;  // lost
    const auto match = matcher.Match(Truth(0).At(step), TimeOf(step) + kNsPerMs, step, timeline);
    ASSERT_EQ(match, step);
    timeline.Correct(step, Truth(0).At(step));
  }
}

// Some replies are late by almost a period, and then one is lost. The next, in time, answers its own request, not the one
// before. The vehicle is at rest, so that content tells nothing.
TEST(ReplyMatcherTest, OneLateReplyDoesNotMakeTheOthersLate) {
  const MotionState at_rest =
      ToMotion({.z_m = 2, .pitch_rad = -0.0117F, .alpha_r_rad = 0.0117F, .alpha_l_rad = 0.0116F});
  MotionTimeline timeline;
  ReplyMatcher matcher;
  timeline.Begin(0, at_rest, kHoverInputs);
  int count = 0;
  for (ModelStep step = 3; step < 960; step += 3, ++count) {
    matcher.Request(step, TimeOf(step));
    const bool late = count % 20 == 10, lost = count % 20 == 11;
    if (lost) continue;
    const TimeNs now = TimeOf(step) + (late ? 11 : 1) * kNsPerMs;
    const auto match = matcher.Match(at_rest, now, late ? step + 2 : step, timeline);
    ASSERT_TRUE(match);
    ASSERT_TRUE(matcher.answers_newest()) << step;
    timeline.Correct(*match, at_rest);
  }
}

TEST(AcceptedRepliesTest, TellsAReplyThatComesOnceMore) {
  AcceptedReplies replies;
  const auto reply = [](int number) { return Sensors{.x_m = static_cast<float>(number)}; };
  EXPECT_FALSE(replies.HasOlder(reply(0)));
  for (int number = 0; number < 100; ++number) {
    EXPECT_FALSE(replies.HasOlder(reply(number)));
    replies.Add(reply(number));
    EXPECT_FALSE(replies.HasOlder(reply(number))) << "the latest may be that of a vehicle at rest";
    for (int age = 1; age < 16 && age <= number; ++age) EXPECT_TRUE(replies.HasOlder(reply(number - age)));
    EXPECT_FALSE(replies.HasOlder(reply(number - 16))) << "forgotten";
  }
  for (int i = 0; i < 20; ++i) replies.Add(reply(7));
  EXPECT_FALSE(replies.HasOlder(reply(7)));
}

// A board that counts time in ticks of 1 ms reads the tick before the request had left.
TEST(ReplyMatcherTest, AClockOfWholeTicksIsPreciseEnough) {
  MotionTimeline timeline;
  ReplyMatcher matcher;
  matcher.Request(0, TimeOf(0));  // its reply began the timeline
  timeline.Begin(0, Truth(0).At(0), kHoverInputs);
  for (ModelStep step = 3; step < 30; step += 3) {
    timeline.Command(step - 2, CommandOf(step - 3));
    matcher.Request(step, TimeOf(step) + 90 * kNsPerUs);
    ASSERT_EQ(matcher.Match(Truth(0).At(step), TimeOf(step), step, timeline), step);
    EXPECT_TRUE(matcher.answers_newest());
    timeline.Correct(step, Truth(0).At(step));
  }
}

// A push that comes between two samples looks like motion of more or less time. On a line in time, a reply is stamped
// with its request's step all the same: one step before would be taken up by all that follow.
TEST(ReplyMatcherTest, AReplyShowsNothingFromBeforeItsRequest) {
  Truth truth(0);
  MotionTimeline timeline;
  ReplyMatcher matcher;
  timeline.Begin(0, truth.At(0), kHoverInputs);
  for (ModelStep step = 3; step < 60; step += 3) {
    timeline.Command(step - 2, CommandOf(step - 3));
    matcher.Request(step, TimeOf(step) + 90 * kNsPerUs);
    const MotionState sample = truth.At(step - 1);
    ASSERT_EQ(matcher.Match(sample, TimeOf(step) + 830 * kNsPerUs, step, timeline), step);
    timeline.Correct(step, sample);
  }
}

TEST(ReplyMatcherTest, ASecondReplyToOneRequestIsNone) {
  MotionTimeline timeline;
  ReplyMatcher matcher;
  timeline.Begin(0, Truth(0).At(0), kHoverInputs);
  matcher.Request(3, TimeOf(3));
  EXPECT_TRUE(matcher.Match(Truth(0).At(3), TimeOf(3) + kNsPerMs, 3, timeline));
  EXPECT_FALSE(matcher.Match(Truth(0).At(3), TimeOf(3) + 2 * kNsPerMs, 3, timeline));
}

// Commands per period of 60 periods, when replies come `late_ns` after their requests and each `lost`-th not at all.
// Commands act from the next period on, which the firmware has to find out.
std::array<int, 60> CommandsPerPeriod(TimeNs late_ns, int lost) {
  TolerantControl control(*FindBuild("tolerant")->gain, FindBuild("tolerant")->feed_forward);
  MotionState state = ToMotion(kMoving);
  Actuators in_force = kHoverInputs, sent = kHoverInputs;
  std::array<int, 60> count{};
  for (int period = 0; period < 60; ++period) {
    const ModelStep step = 3 * period;
    const TimeNs begin = TimeOf(step);
    control.NoteRequest({.origin_ns = 0, .begin_ns = begin, .sent_ns = begin + 90 * kNsPerUs});
    TimeNs reply = begin + (period < 5 ? 830 * kNsPerUs : late_ns);
    if (period >= 5 && lost > 0 && period % lost == 0) reply = std::numeric_limits<TimeNs>::max();
    const Sensors sensors = ToSensors(state);
    in_force = sent;
    for (int i = 0; i < 3; ++i) StepMotion(kTiltrotorConstants, in_force, state);
    int& commands = count[static_cast<std::size_t>(period)];
    const auto send = [&](const std::optional<Actuators>& command) {
      if (!command) return;
      ++commands;
      sent = *command;
    };
    for (const TimeNs timeout : {begin + 2 * kNsPerMs, begin + 6 * kNsPerMs, begin + 10 * kNsPerMs}) {
      if (reply < timeout) {
        send(control.OnReply(reply, sensors, {.z_m = 1}));
        reply = std::numeric_limits<TimeNs>::max();
      }
      send(control.OnTimeout(timeout, {.z_m = 1}));
    }
  }
  return count;
}

// More would fill a line that is slow, and make all that follows later still.
TEST(TolerantControlTest, ALineThatIsLateAndLosesNothingGetsOneCommandPerPeriod) {
  for (const TimeNs late_ms : {3, 5, 8}) {
    const auto count = CommandsPerPeriod(late_ms * kNsPerMs, 0);
    for (std::size_t period = 10; period < count.size(); ++period) {
      EXPECT_EQ(count[period], 1) << late_ms << " ms, period " << period;
    }
  }
}

TEST(TolerantControlTest, ALineThatLosesRepliesGetsFurtherCommands) {
  const auto count = CommandsPerPeriod(3 * kNsPerMs, 3);
  EXPECT_GT(*std::max_element(count.begin() + 10, count.end()), 1);
}

// Exact to one step, because a smaller difference is within the spread.
TEST(LagEstimatorTest, FindsEveryLagAndFollowsItBack) {
  for (ModelStep lag = 1; lag <= MotionTimeline::kLagMax; ++lag) {
    Truth truth(lag);
    MotionTimeline timeline;
    LagEstimator estimator;
    timeline.Begin(0, truth.At(0), kHoverInputs);
    for (ModelStep step = 3; step < 150; step += 3) {
      timeline.Command(step - 2, CommandOf(step - 3));
      estimator.Update(timeline, step, truth.At(step));
      timeline.Correct(step, truth.At(step));
    }
    EXPECT_NEAR(timeline.lag(), lag, 1);
    EXPECT_TRUE(estimator.model_is_right());
    Truth undelayed(0);
    timeline.Correct(150, undelayed.At(150));
    for (ModelStep step = 153; step < 300; step += 3) {
      timeline.Command(step - 2, CommandOf(step - 3));
      estimator.Update(timeline, step, undelayed.At(step));
      timeline.Correct(step, undelayed.At(step));
    }
    EXPECT_NEAR(timeline.lag(), 0, 1) << "after " << lag;
  }
}

TEST(LagEstimatorTest, OneLostCommandIsNoLag) {
  MotionTimeline timeline;
  LagEstimator estimator;
  MotionState state = ToMotion(kMoving);
  timeline.Begin(0, state, kHoverInputs);
  Actuators in_force = kHoverInputs;
  for (ModelStep step = 0; step < 300; step += 3) {
    StepMotion(kTiltrotorConstants, in_force, state);
    timeline.Command(step + 1, CommandOf(step));
    if (step % 30 != 0) in_force = CommandOf(step);
    StepMotion(kTiltrotorConstants, in_force, state);
    StepMotion(kTiltrotorConstants, in_force, state);
    estimator.Update(timeline, step + 3, state);
    timeline.Correct(step + 3, state);
    ASSERT_EQ(timeline.lag(), 0) << step;
  }
}

TEST(LagEstimatorTest, NoiseIsNoLag) {
  std::mt19937 engine(1);
  Truth truth(0);
  MotionTimeline timeline;
  LagEstimator estimator;
  timeline.Begin(0, truth.At(0), kHoverInputs);
  for (ModelStep step = 3; step < 600; step += 3) {
    timeline.Command(step - 2, CommandOf(step - 3));
    MotionState noisy = truth.At(step);
    noisy.p_WC_m =
        noisy.p_WC_m + 2e-3F * Vector3{NearlyNormal(engine), NearlyNormal(engine), NearlyNormal(engine)};
    noisy.v_WC_m_s =
        noisy.v_WC_m_s + 1e-2F * Vector3{NearlyNormal(engine), NearlyNormal(engine), NearlyNormal(engine)};
    noisy.w_WB_rad_s =
        noisy.w_WB_rad_s + 1e-2F * Vector3{NearlyNormal(engine), NearlyNormal(engine), NearlyNormal(engine)};
    for (float& rate_rad_s : noisy.alpha_rad_s) rate_rad_s += 3e-2F * NearlyNormal(engine);
    estimator.Update(timeline, step, noisy);
    timeline.Correct(step, noisy);
    ASSERT_EQ(timeline.lag(), 0) << step;
  }
  EXPECT_TRUE(estimator.model_is_right());
}

}  // namespace
}  // namespace tiltproof::firmware
