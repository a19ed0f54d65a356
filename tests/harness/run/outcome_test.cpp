// Who is to blame when several speak of one trouble.
#include "harness/run/realtime/outcome.h"

#include <gtest/gtest.h>

namespace tiltproof::harness {
namespace {

using std::chrono::milliseconds;

const Outcome::Clock::time_point kNow{std::chrono::seconds(100)};

TEST(Outcome, FirstReasonCounts) {
  Outcome outcome;
  EXPECT_FALSE(outcome.ended());
  outcome.End(EndReason::kNodeLost, "plant", 5);
  outcome.End(EndReason::kFirmwareLost, "client", 6);
  outcome.End(EndReason::kCompleted, "", 7);
  EXPECT_EQ(outcome.reason(), EndReason::kNodeLost);
  EXPECT_EQ(outcome.text(), "plant");
  EXPECT_EQ(outcome.end_ns(), 5);
}

TEST(Outcome, TroubleAfterTheFlightIsStillTrouble) {
  for (const EndReason late : {EndReason::kNodeLost, EndReason::kFirmwareCrashed, EndReason::kHarnessError}) {
    Outcome outcome;
    outcome.End(EndReason::kCompleted, "", 60);
    outcome.End(late, "late", 61);
    EXPECT_EQ(outcome.reason(), late);
    EXPECT_EQ(outcome.end_ns(), 60);  // the flight was as long as it was
  }
  Outcome outcome;
  outcome.End(EndReason::kDiverged, "tilted", 4);
  outcome.End(EndReason::kCompleted, "", 60);
  EXPECT_EQ(outcome.reason(), EndReason::kDiverged);
}

TEST(Outcome, ANodesWordWaitsForWhatWeSeeOurselves) {
  Outcome outcome;
  outcome.Hear(EndReason::kNodeLost, "the client's port is gone", 5, kNow);
  outcome.Settle(kNow + milliseconds(249), false);
  EXPECT_FALSE(outcome.ended());
  outcome.Settle(kNow + milliseconds(900), true);  // a node is silent
  EXPECT_FALSE(outcome.ended());
  outcome.End(EndReason::kNodeLost, "the link node was killed", 5);
  outcome.Settle(kNow + milliseconds(1000), false);
  EXPECT_EQ(outcome.text(), "the link node was killed");
}

TEST(Outcome, ANodesWordIsBelievedInTheEnd) {
  Outcome outcome;
  outcome.Hear(EndReason::kFirmwareCrashed, "crashed", 5, kNow);
  outcome.Hear(EndReason::kNodeLost, "a port is gone", 6, kNow);
  outcome.Settle(kNow + Outcome::kHearsayLimit, false);
  EXPECT_EQ(outcome.reason(), EndReason::kFirmwareCrashed);
  EXPECT_EQ(outcome.end_ns(), 5);
}

TEST(Outcome, AnInterruptOverridesAll) {
  Outcome outcome;
  outcome.End(EndReason::kNodeLost, "plant", 5);
  outcome.Interrupt(9);
  EXPECT_EQ(outcome.reason(), EndReason::kInterrupted);
  EXPECT_EQ(outcome.end_ns(), 5);
}

}  // namespace
}  // namespace tiltproof::harness
