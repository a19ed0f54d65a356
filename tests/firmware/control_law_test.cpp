#include "firmware/control_law.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "firmware/builds.h"

namespace tiltproof::firmware {
namespace {

// The law again, in double precision and in another form: the integrals as sums over the whole history, the
// product row by row.
class ReferenceLaw {
 public:
  explicit ReferenceLaw(const Build& build) : build_(build) {}

  ActuatorsTruth Step(const SensorsTruth& s, const ReferenceTruth& r) {
    history_.push_back({s.x_m - r.x_m, s.y_m - r.y_m, s.z_m - r.z_m, s.yaw_rad - r.yaw_rad});
    std::vector<double> error;
    for (const auto& field : kSensorFields) error.push_back(s.*field.in_double);
    error[0] -= r.x_m;
    error[1] -= r.y_m;
    error[2] -= r.z_m;
    error[5] -= r.yaw_rad;
    error[8] -= r.vx_m_s;
    error[9] -= r.vy_m_s;
    error[10] -= r.vz_m_s;
    for (std::size_t i = 0; i < 4; ++i) {
      double sum =
          0.5 *
          history_.back()[i];  // trapezoids from a zero sample: every inner one whole, the last one half
      for (std::size_t k = 0; k + 1 < history_.size(); ++k) sum += history_[k][i];
      error.push_back(0.012 * sum);
    }
    ActuatorsTruth u = ToDouble(build_.feed_forward, kActuatorFields);
    for (std::size_t row = 0; row < 4; ++row) {
      double product = 0;
      for (std::size_t column = 0; column < error.size(); ++column) {
        product += static_cast<double>((*build_.gain)[row][column]) * error[column];
      }
      u.*kActuatorFields[row].in_double -= product;
    }
    return u;
  }

 private:
  const Build& build_;
  std::vector<std::array<double, 4>> history_;
};

// A portable sequence in [-1, 1).
class Noise {
 public:
  double Next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 33) / static_cast<double>(1U << 30) - 1.0;
  }

 private:
  std::uint64_t state_ = 1;
};

class ControlLawTest : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Builds, ControlLawTest, ::testing::Values("paper", "paper_published", "tolerant"));

TEST_P(ControlLawTest, AgreesWithDoublePrecisionOverAFlight) {
  const Build& build = *FindBuild(GetParam());
  ControlLaw law(*build.gain, build.feed_forward);
  ReferenceLaw oracle(build);
  Noise noise;
  for (int k = 0; k < 2000; ++k) {
    Sensors sensors;
    for (const auto& field : kSensorFields) sensors.*field.in_float = static_cast<float>(noise.Next());
    Reference reference;
    for (const auto& field : kReferenceFields) reference.*field.in_float = static_cast<float>(noise.Next());
    const Actuators got = law.Step(sensors, reference);
    const ActuatorsTruth expected =
        oracle.Step(ToDouble(sensors, kSensorFields), ToDouble(reference, kReferenceFields));
    for (const auto& field : kActuatorFields) {
      ASSERT_NEAR(static_cast<double>(got.*field.in_float), expected.*field.in_double, 2e-5)
          << field.column << " at step " << k;
    }
  }
}

TEST_P(ControlLawTest, AtTheReferenceGivesTheFeedForward) {
  const Build& build = *FindBuild(GetParam());
  ControlLaw law(*build.gain, build.feed_forward);
  const Sensors sensors{
      .x_m = 2, .y_m = -3, .z_m = 0.5F, .yaw_rad = 0.25F, .vx_m_s = 1, .vy_m_s = -1, .vz_m_s = 0.5F};
  const Reference reference{2, -3, 0.5F, 0.25F, 1, -1, 0.5F};
  for (int k = 0; k < 3; ++k) EXPECT_EQ(law.Step(sensors, reference), build.feed_forward);
}

// Signs that a person can check: below the reference more thrust, rolled right (left wing up) more thrust on
// the right.
TEST_P(ControlLawTest, PushesTowardsTheReference) {
  const Build& build = *FindBuild(GetParam());
  const Actuators low = ControlLaw(*build.gain, build.feed_forward).Step({.z_m = -1}, {});
  EXPECT_GT(low.f_r_n, build.feed_forward.f_r_n + 1);
  EXPECT_GT(low.f_l_n, build.feed_forward.f_l_n + 1);
  const Actuators rolled = ControlLaw(*build.gain, build.feed_forward).Step({.roll_rad = 0.1F}, {});
  EXPECT_GT(rolled.f_r_n, build.feed_forward.f_r_n);
  EXPECT_LT(rolled.f_l_n, build.feed_forward.f_l_n);
}

TEST_P(ControlLawTest, IntegralsStartFromAZeroSample) {
  const Build& build = *FindBuild(GetParam());
  ControlLaw law(*build.gain, build.feed_forward);
  const Gain& gain = *build.gain;
  const float first = law.Step({.z_m = 1}, {}).f_r_n;
  const float second = law.Step({.z_m = 1}, {}).f_r_n;
  EXPECT_NEAR(first, build.feed_forward.f_r_n - gain[0][2] - 0.006F * gain[0][18], 1e-5F);
  EXPECT_NEAR(second, build.feed_forward.f_r_n - gain[0][2] - 0.018F * gain[0][18], 1e-5F);
}

TEST_P(ControlLawTest, KeepsANumberThatIsNotFinite) {
  const Build& build = *FindBuild(GetParam());
  ControlLaw law(*build.gain, build.feed_forward);
  EXPECT_TRUE(std::isnan(law.Step({.x_m = std::numeric_limits<float>::quiet_NaN()}, {}).f_r_n));
  EXPECT_TRUE(std::isnan(law.Step({}, {}).f_r_n));
}

TEST(BuildsTest, AreFoundByNameOnly) {
  for (const Build& build : Builds()) EXPECT_EQ(FindBuild(build.name), &build);
  EXPECT_EQ(FindBuild("papers"), nullptr);
  EXPECT_EQ(FindBuild(""), nullptr);
}

}  // namespace
}  // namespace tiltproof::firmware
