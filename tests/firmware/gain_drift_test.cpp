// The committed gain tables and hover inputs are what the design computes from the shipped models today.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "firmware/builds.h"
#include "plant/lqr_design.h"
#include "plant/vehicle_model.h"

namespace tiltproof::firmware {
namespace {

// Rounding to binary32 is 6e-8 relative; the rest is for other compilers' rounding inside the design.
constexpr double kTolerance = 1e-6;

struct Case {
  const char* build;
  const char* model;
  const char* table;
};

class GainDriftTest : public ::testing::TestWithParam<Case> {
 protected:
  static plant::LqrDesign Design() {
    std::vector<std::string> warnings;
    return plant::DesignLqr(plant::LoadVehicle(
        std::string(TILTPROOF_SOURCE_DIR "/plant/models/") + GetParam().model, {}, warnings));
  }
};
INSTANTIATE_TEST_SUITE_P(Builds, GainDriftTest,
                         ::testing::Values(Case{"paper", "tiltrotor.sdf", "kTiltrotorGain"},
                                           Case{"tolerant", "tiltrotor.sdf", "kTiltrotorGain"},
                                           Case{"paper_published", "tiltrotor_published.sdf",
                                                "kTiltrotorPublishedGain"}),
                         [](const auto& one) { return one.param.build; });

TEST_P(GainDriftTest, TheCommittedTableIsTheDesigns) {
  const Build* build = FindBuild(GetParam().build);
  ASSERT_NE(build, nullptr);
  const plant::LqrDesign design = Design();
  for (std::size_t row = 0; row < kActuatorCount; ++row) {
    for (std::size_t column = 0; column < kStateCount; ++column) {
      const double expected = design.gain(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
      ASSERT_NEAR(static_cast<double>((*build->gain)[row][column]), expected, kTolerance * std::abs(expected))
          << "row " << row << ", column " << column << "; put this into firmware/gain_tables.h:\n"
          << plant::FirmwareGainTable(design.gain, GetParam().table);
    }
  }
}

// The paper's feed-forward is the paper's; only that of the other model is designed.
TEST(FeedForwardDriftTest, ThePublishedModelsIsItsHover) {
  std::vector<std::string> warnings;
  const plant::VehicleModel model =
      plant::LoadVehicle(TILTPROOF_SOURCE_DIR "/plant/models/tiltrotor_published.sdf", {}, warnings);
  const plant::Hover hover = plant::DesignLqr(model).hover;
  const Build* build = FindBuild("paper_published");
  ASSERT_NE(build, nullptr);
  for (std::size_t i = 0; i < kActuatorCount; ++i) {
    const auto& field = kActuatorFields[i];
    const double expected = hover.input.at(i);
    EXPECT_NEAR(static_cast<double>(build->feed_forward.*field.in_float), expected,
                kTolerance * std::abs(expected))
        << field.column;
  }
}

}  // namespace
}  // namespace tiltproof::firmware
