#include "harness/score/headline.h"

#include <gtest/gtest.h>

#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"

namespace tiltproof::harness {
namespace {

CriterionSpec Formula(const std::string& name, const std::string& text) {
  CriterionSpec spec;
  spec.name = name;
  spec.stl = text;
  return spec;
}

CriterionSpec Count(const std::string& name, const std::string& metric, double min, double max) {
  CriterionSpec spec;
  spec.name = name;
  spec.metric = metric;
  spec.min = min;
  spec.max = max;
  return spec;
}

// A flight of 1.2 s that is nearest to its bound at 0.12 s, with a fault from 0.6 s on that moves it by 0.2 m.
class Headline : public ::testing::Test {
 protected:
  void SetUp() override {
    Set(log_, 10, "roll_rad", 0.5);
    Set(log_, 80, "x_m", 0.2);
    log_.fault_activation_counts = {1};
    scenario_ = ScenarioOf(log_);
    scenario_.faults = {Fault("push", FromSeconds(0.6), kNever)};
  }

  RunLog log_ = StillFlight(101);
  Scenario scenario_;
};

TEST_F(Headline, IsOfWhatTheFaultCanHaveChanged) {
  scenario_.criteria = {Formula("upright", "always(roll_rad <= 0.6)"),
                        Formula("near", "always(position_error_m <= 1)")};
  const Score score = ScoreRun(scenario_, log_);
  ASSERT_LT(score.criteria[1].margin.value(), score.criteria[2].margin.value());
  EXPECT_EQ(score.criteria[1].fault_can_affect, false);
  EXPECT_EQ(score.criteria[2].fault_can_affect, true);
  EXPECT_EQ(HeadlineCriterion(score)->name, "near");
  EXPECT_EQ(LeastMargin(score), 0.8);
  // The row of the fault's start counts, and one fault earlier makes the other criterion count.
  scenario_.faults.push_back(Fault("early", FromSeconds(0.12), kNever));
  EXPECT_EQ(HeadlineCriterion(ScoreRun(scenario_, log_))->name, "upright");
}

TEST_F(Headline, WithoutAFaultAllCriteriaCount) {
  scenario_.faults.clear();
  scenario_.criteria = {Formula("upright", "always(roll_rad <= 0.6)"),
                        Formula("near", "always(position_error_m <= 1)")};
  const Score score = ScoreRun(scenario_, log_);
  EXPECT_FALSE(score.criteria[1].fault_can_affect);
  EXPECT_EQ(HeadlineCriterion(score)->name, "upright");
}

TEST_F(Headline, WhatFollowsFromTheScenarioIsNoFaultsDoing) {
  scenario_.criteria = {Formula("low", "always[0.8,1](z_ref_m <= 0.001)"),
                        Formula("one", "always[0.8,1](faults_active_count <= 1)"),
                        Formula("near", "always(position_error_m <= 1)")};
  const Score score = ScoreRun(scenario_, log_);
  ASSERT_EQ(score.verdict, Verdict::kPass) << score.reason;
  EXPECT_EQ(score.criteria[1].fault_can_affect, false);
  EXPECT_EQ(score.criteria[2].fault_can_affect, false);
  EXPECT_EQ(HeadlineCriterion(score)->name, "near");
  // A formula that compares the vehicle with the reference is about the vehicle.
  scenario_.criteria = {Formula("above", "always[0.9,1](x_m - x_ref_m <= 0.1)")};
  EXPECT_EQ(ScoreRun(scenario_, log_).criteria[1].fault_can_affect, true);
}

TEST_F(Headline, AViolationCountsWheneverItHappened) {
  scenario_.criteria = {Formula("upright", "always(roll_rad <= 0.4)"),
                        Formula("near", "always(position_error_m <= 1)")};
  const Score score = ScoreRun(scenario_, log_);
  EXPECT_EQ(score.criteria[1].fault_can_affect, false);
  EXPECT_EQ(HeadlineCriterion(score)->name, "upright");
  EXPECT_LT(LeastMargin(score).value(), 0);
}

TEST_F(Headline, AnExactCountThatIsMetHasNoMargin) {
  scenario_.criteria = {Count("started", "firmware.restarts_count", 0, 0),
                        Count("starts", "timing.firmware_missed_count", 101, 101),
                        Formula("near", "always(position_error_m <= 1)")};
  ScoreRun(scenario_, log_);
  const double missed = ScoreRun(scenario_, log_).metrics.at("timing.firmware_missed_count");
  ASSERT_GT(missed, 0);
  scenario_.criteria[1] = Count("missed", "timing.firmware_missed_count", missed, missed);
  const Score score = ScoreRun(scenario_, log_);
  EXPECT_EQ(score.criteria[2].verdict, Verdict::kPass);
  EXPECT_FALSE(score.criteria[2].margin);
  EXPECT_EQ(HeadlineCriterion(score)->name, "near");
  // One that is missed has a margin, below 0.
  scenario_.criteria[1] = Count("missed", "timing.firmware_missed_count", missed + 1, missed + 1);
  EXPECT_LT(LeastMargin(ScoreRun(scenario_, log_)).value(), 0);
}

TEST_F(Headline, IsNoneWhenNoFaultCanHaveChangedAnything) {
  scenario_.criteria = {Formula("upright", "always(roll_rad <= 0.6)")};
  const Score score = ScoreRun(scenario_, log_);
  EXPECT_EQ(score.verdict, Verdict::kPass);
  EXPECT_EQ(HeadlineCriterion(score), nullptr);
  EXPECT_FALSE(LeastMargin(score));
}

}  // namespace
}  // namespace tiltproof::harness
