// Each class of outcome, and which one wins when several fit.
#include "harness/score/outcome.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace tiltproof::harness {
namespace {

struct Flown {
  RunLog log;
  Score score;
};

// A minute in which the firmware asked for sensors to the end and stayed on its path.
Flown Good() {
  Flown flown;
  flown.log.end_ns = 60 * kNsPerS;
  flown.log.clients[0].sent_request_times_ns = {0, 59'990 * kNsPerMs};
  flown.score.verdict = Verdict::kPass;
  flown.score.metrics = {{"tracking.rmse_before_faults_m", 0.1}, {"tracking.rmse_since_faults_m", 0.15}};
  return flown;
}

Outcome Of(const Flown& flown) { return OutcomeOf(flown.log, flown.score); }

TEST(Outcome, EachClassHasItsSign) {
  EXPECT_EQ(Of(Good()), Outcome::kUnaffected);
  Flown flown = Good();
  flown.score.metrics["tracking.rmse_since_faults_m"] = 0.151;
  EXPECT_EQ(Of(flown), Outcome::kDegraded);
  flown.score.metrics.erase("tracking.rmse_before_faults_m");  // nothing to compare with
  EXPECT_EQ(Of(flown), Outcome::kUnaffected);
  flown = Good();
  flown.score.restarts = 1;
  EXPECT_EQ(Of(flown), Outcome::kDetected);
  flown = Good();
  flown.log.clients[0].failsafe_entered_count = 0;
  EXPECT_EQ(Of(flown), Outcome::kUnaffected);
  flown.log.clients[0].failsafe_entered_count = 2;
  EXPECT_EQ(Of(flown), Outcome::kDetected);
  flown = Good();
  flown.score.verdict = Verdict::kFail;
  EXPECT_EQ(Of(flown), Outcome::kFailed);
  flown = Good();
  flown.log.end_reason = EndReason::kFirmwareHung;
  EXPECT_EQ(Of(flown), Outcome::kHung);
  for (const EndReason reason : {EndReason::kFirmwareCrashed, EndReason::kFirmwareLost}) {
    flown = Good();
    flown.log.end_reason = reason;
    EXPECT_EQ(Of(flown), Outcome::kCrashed);
  }
  flown = Good();
  flown.score.verdict = Verdict::kError;
  EXPECT_EQ(Of(flown), Outcome::kError);
}

TEST(Outcome, AFirmwareThatFallsSilentHangs) {
  Flown flown = Good();
  flown.log.clients[0].sent_request_times_ns = {0, 59'500 * kNsPerMs};
  EXPECT_EQ(Of(flown), Outcome::kUnaffected);
  flown.log.clients[0].sent_request_times_ns = {0, 59'500 * kNsPerMs - 1};
  EXPECT_EQ(Of(flown), Outcome::kHung);
  flown.log.clients[0].sent_request_times_ns = {};  // it never flew
  EXPECT_EQ(Of(flown), Outcome::kUnaffected);
  // A machine that was too late to judge the flight may have missed what was sent.
  flown = Good();
  flown.score.verdict = Verdict::kInconclusive;
  flown.log.clients[0].sent_request_times_ns = {0};
  EXPECT_EQ(Of(flown), Outcome::kUnaffected);
  // One of two is enough.
  flown = Good();
  flown.log.clients.push_back(flown.log.clients[0]);
  flown.log.clients[1].sent_request_times_ns = {0};
  EXPECT_EQ(Of(flown), Outcome::kHung);
}

// The order of the classes: trouble of ours, then what the firmware did, then what the vehicle did.
TEST(Outcome, TheFirstThatFitsWins) {
  Flown flown = Good();
  flown.score.metrics["tracking.rmse_since_faults_m"] = 1;
  flown.score.restarts = 1;
  EXPECT_EQ(Of(flown), Outcome::kDetected);
  flown.score.verdict = Verdict::kFail;
  EXPECT_EQ(Of(flown), Outcome::kFailed);
  flown.log.clients[0].sent_request_times_ns = {0};
  EXPECT_EQ(Of(flown), Outcome::kHung);
  flown.log.end_reason = EndReason::kFirmwareCrashed;
  EXPECT_EQ(Of(flown), Outcome::kCrashed);
  flown.score.verdict = Verdict::kError;
  EXPECT_EQ(Of(flown), Outcome::kError);
}

TEST(Outcome, NamesAreDifferent) {
  std::set<std::string_view> names;
  for (int i = 0; i <= static_cast<int>(Outcome::kUnaffected); ++i)
    names.insert(Name(static_cast<Outcome>(i)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(Outcome::kUnaffected) + 1);
  EXPECT_FALSE(names.contains("unknown"));
}

}  // namespace
}  // namespace tiltproof::harness
