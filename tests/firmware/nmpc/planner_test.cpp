// The planner in closed loop with its own model, and the law around it.
#include "firmware/examples/nmpc/planner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "firmware/examples/nmpc/nmpc_law.h"
#include "tests/firmware/nmpc/vehicles.h"

namespace tiltproof::nmpc {
namespace {

struct Flown {
  std::vector<double> inputs;  // all of them, one after the other
  double tilt_max_rad = 0, input_max = 0, distance_end_m = 0;
};

// A step to the side and up, from hover.
Flown FlyStep(const std::string& name, const Options& options, int periods) {
  const Rotorcraft vehicle = VehicleOf(ShippedModel(name));
  const auto planner = MakePlanner(vehicle, options);
  std::vector<double> x(12 + 2 * vehicle.hinges.size(), 0);
  PathPoint target;
  target.p_m << 0.3, 1.5, 0.2;
  const std::vector<PathPoint> path(planner->lengths_s().size() + 1, target);
  Flown flown;
  for (int i = 0; i < periods; ++i) {
    const double now_s = i * vehicle.period_s;
    planner->Plan(x, {}, now_s, path);
    planner->Adopt();
    const std::vector<double> u = planner->InputAt(now_s);
    for (std::size_t k = 0; k < vehicle.rotors.size(); ++k) flown.input_max = std::max(flown.input_max, u[k]);
    flown.inputs.insert(flown.inputs.end(), u.begin(), u.end());
    x = planner->Predict(x, u, {}, vehicle.period_s);
    flown.tilt_max_rad = std::max(flown.tilt_max_rad, std::acos(std::cos(x[3]) * std::cos(x[4])));
  }
  flown.distance_end_m = (Eigen::Vector3d(x[0], x[1], x[2]) - target.p_m).norm();
  return flown;
}

TEST(NmpcPlannerTest, EveryNumberOfThreadsHasEqualBits) {
  const Flown one = FlyStep("tiltrotor", {.threads = 1}, 12);
  for (const int threads : {2, 4, 64}) {
    const Flown many = FlyStep("tiltrotor", {.threads = threads}, 12);
    ASSERT_EQ(one.inputs.size(), many.inputs.size());
    EXPECT_EQ(std::memcmp(one.inputs.data(), many.inputs.data(), one.inputs.size() * sizeof(double)), 0)
        << threads;
  }
}

TEST(NmpcPlannerTest, KeepsLimitsThatItWouldOtherwiseBreak) {
  const Flown free = FlyStep("tiltrotor", {.tilt_max_rad = 0.6}, 250);
  EXPECT_GT(free.tilt_max_rad, 0.2);
  EXPECT_LT(free.distance_end_m, 0.05);
  const Flown held = FlyStep("tiltrotor", {.tilt_max_rad = 0.12, .thrust_max_n = 10.8}, 250);
  EXPECT_LE(held.tilt_max_rad, 0.125);
  EXPECT_LE(held.input_max, 10.8);
  EXPECT_LT(held.distance_end_m, 0.4);
}

TEST(NmpcPlannerTest, FliesAQuadrotor) { EXPECT_LT(FlyStep("quadrotor", {}, 250).distance_end_m, 0.05); }

// The last of five intervals over 1.2 s is 0.78 s long. The plans diverge, and after ten periods they held no numbers.
TEST(NmpcPlannerTest, APlanThatDivergesIsNotFlown) {
  const Flown flown = FlyStep("tiltrotor", {.intervals = 5, .sweeps_max = 4}, 30);
  for (const double u : flown.inputs) ASSERT_TRUE(std::isfinite(u));
}

TEST(NmpcPlannerTest, RefusesAHorizonThatItsIntervalsCannotCover) {
  EXPECT_EQ(HorizonProblem({}, 0.012), "");
  EXPECT_EQ(HorizonProblem({.intervals = 8}, 0.012), "");
  EXPECT_EQ(HorizonProblem({.intervals = 3}, 0.012),
            "3 intervals cover 0.252 s at most, because each is at most 4 times as long as the one before: "
            "horizon_s is "
            "1.2; use more intervals, or a shorter horizon");
  EXPECT_EQ(HorizonProblem({.intervals = 5}, 0.012),
            "the last of 5 intervals over horizon_s = 1.2 is 0.782 s long, and at most 0.6 s are allowed, "
            "because the "
            "plan diverges over a longer one; use more intervals, or a shorter horizon");
}

TEST(ReferencePreviewTest, ContinuesASpiralExactly) {
  const auto at = [](double t) {
    return Reference{.x_m = static_cast<float>(5 * std::sin(0.3 * t)),
                     .y_m = static_cast<float>(-5 * std::cos(0.3 * t)),
                     .z_m = static_cast<float>(0.2 * t),
                     .vx_m_s = static_cast<float>(1.5 * std::cos(0.3 * t)),
                     .vy_m_s = static_cast<float>(1.5 * std::sin(0.3 * t)),
                     .vz_m_s = 0.2F};
  };
  ReferencePreview preview;
  for (int i = 0; i <= 20; ++i) preview.Add(0.012 * i, at(0.012 * i));
  const auto path = preview.Path(0.24, {0.1, 0.4, 0.5});
  ASSERT_EQ(path.size(), 4U);
  const std::array<double, 4> times = {0.24, 0.34, 0.74, 1.24};
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Reference expected = at(times[i]);
    EXPECT_NEAR(path[i].p_m[0], expected.x_m, 1e-4);
    EXPECT_NEAR(path[i].p_m[1], expected.y_m, 1e-4);
    EXPECT_NEAR(path[i].p_m[2], expected.z_m, 1e-4);
    EXPECT_NEAR(path[i].v_m_s[1], expected.vy_m_s, 1e-4);
  }
}

TEST(ReferencePreviewTest, AJumpHasNoFuture) {
  ReferencePreview preview;
  preview.Add(0, {.vx_m_s = 1});
  preview.Add(0.012, {.x_m = 5, .vy_m_s = 1});
  const auto path = preview.Path(0.012, {1});
  EXPECT_NEAR(path[1].p_m[0], 5, 1e-6);
  EXPECT_NEAR(path[1].p_m[1], 1, 1e-6);
}

// A period is 12 ms, a plan takes 30 ms: three periods.
TEST(NmpcLawTest, FliesTheShiftedPlanUntilALatePlanIsReady) {
  const Rotorcraft vehicle = VehicleOf(ShippedModel("tiltrotor"));
  constexpr TimeNs kMs = 1'000'000;
  int computed = 0;
  NmpcLaw law(vehicle, {.compute_us = 100}, true, [&](TimeNs now, TimeNs length, TimeNs) {
    EXPECT_GE(length, 4 * kMs);  // 20 intervals, one integration and one sweep or more
    ++computed;
    return now + 30 * kMs;
  });
  ASSERT_TRUE(law.can_fly());
  const std::array<float, 16> sensed{};
  const Reference reference = {.y_m = 1};
  std::vector<std::vector<float>> commands;
  for (TimeNs now = 1000 * kMs; now < 1072 * kMs; now += 12 * kMs) {
    std::vector<float> command(4);
    EXPECT_EQ(law.Step({.requested = now - kMs, .now = now, .deadline = now + 11 * kMs}, sensed, reference,
                       command),
              now);
    commands.push_back(command);
  }
  EXPECT_EQ(computed, 2);  // at 1000 and at 1036 ms
  const std::vector<float> hover(vehicle.input_hover.begin(), vehicle.input_hover.end());
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(commands[i], hover) << i;  // nothing to shift yet
  EXPECT_NE(commands[3], hover);
  EXPECT_NE(commands[4], commands[3]);  // the next input of the same plan
}

TEST(NmpcLawTest, AQuickPlanLeavesWhenItIsReady) {
  constexpr TimeNs kMs = 1'000'000;
  NmpcLaw law(VehicleOf(ShippedModel("tiltrotor")), {.compute_us = 50}, true,
              [](TimeNs now, TimeNs length, TimeNs) { return now + length; });
  std::array<float, 4> command{};
  const TimeNs leaves = law.Step({.requested = 0, .now = kMs, .deadline = 50 * kMs}, std::array<float, 16>{},
                                 {.y_m = 0.01F}, command);
  EXPECT_EQ(leaves, 3 * kMs);  // 20 intervals, two works on each
}

TEST(NmpcLawTest, RefusesNumbersThatItDoesNotKnow) {
  Options options;
  EXPECT_EQ(ReadOptions(R"({"firmware_parameters": {"intervals": 7, "tilt_max_rad": 0.25}})", options), "");
  EXPECT_EQ(options.intervals, 7);
  EXPECT_EQ(options.tilt_max_rad, 0.25);
  for (const char* none : {"", "{}", "[1", R"({"firmware_parameters": null})"})
    EXPECT_EQ(ReadOptions(none, options), "") << none;
  EXPECT_EQ(
      ReadOptions(R"({"firmware_parameters": {"horizon": 1}})", options),
      "firmware_parameters: this firmware has no horizon; it has intervals horizon_s iterations sweeps_max "
      "threads tilt_max_rad thrust_max_n compute_us");
  for (const char* wrong : {"0", "1.5", "65", "null", "\"2\""})
    EXPECT_NE(
        ReadOptions((R"({"firmware_parameters": {"threads": )" + std::string(wrong) + "}}").c_str(), options)
            .find("threads is a whole number from 1.0 to 64.0"),
        std::string::npos)
        << wrong;
}

}  // namespace
}  // namespace tiltproof::nmpc
