// Who is to blame when several speak of one trouble.
#include "harness/run/realtime/ending.h"

#include <gtest/gtest.h>

namespace tiltproof::harness {
namespace {

using std::chrono::milliseconds;

const Ending::Clock::time_point kNow{std::chrono::seconds(100)};

TEST(Ending, FirstReasonCounts) {
  Ending ending;
  EXPECT_FALSE(ending.ended());
  ending.End(EndReason::kNodeLost, "plant", 5);
  ending.End(EndReason::kFirmwareLost, "client", 6);
  ending.End(EndReason::kCompleted, "", 7);
  EXPECT_EQ(ending.reason(), EndReason::kNodeLost);
  EXPECT_EQ(ending.text(), "plant");
  EXPECT_EQ(ending.end_ns(), 5);
}

TEST(Ending, TroubleAfterTheFlightIsStillTrouble) {
  for (const EndReason late : {EndReason::kNodeLost, EndReason::kFirmwareCrashed, EndReason::kHarnessError}) {
    Ending ending;
    ending.End(EndReason::kCompleted, "", 60);
    ending.End(late, "late", 61);
    EXPECT_EQ(ending.reason(), late);
    EXPECT_EQ(ending.end_ns(), 60);  // the flight was as long as it was
  }
  Ending ending;
  ending.End(EndReason::kDiverged, "tilted", 4);
  ending.End(EndReason::kCompleted, "", 60);
  EXPECT_EQ(ending.reason(), EndReason::kDiverged);
}

TEST(Ending, ANodesWordWaitsForWhatWeSeeOurselves) {
  Ending ending;
  ending.Hear(EndReason::kNodeLost, "the client's port is gone", 5, kNow);
  ending.Settle(kNow + milliseconds(249), false);
  EXPECT_FALSE(ending.ended());
  ending.Settle(kNow + milliseconds(900), true);  // a node is silent
  EXPECT_FALSE(ending.ended());
  ending.End(EndReason::kNodeLost, "the link node was killed", 5);
  ending.Settle(kNow + milliseconds(1000), false);
  EXPECT_EQ(ending.text(), "the link node was killed");
}

TEST(Ending, ANodesWordIsBelievedInTheEnd) {
  Ending ending;
  ending.Hear(EndReason::kFirmwareCrashed, "crashed", 5, kNow);
  ending.Hear(EndReason::kNodeLost, "a port is gone", 6, kNow);
  ending.Settle(kNow + Ending::kHearsayLimit, false);
  EXPECT_EQ(ending.reason(), EndReason::kFirmwareCrashed);
  EXPECT_EQ(ending.end_ns(), 5);
}

TEST(Ending, AnInterruptOverridesAll) {
  Ending ending;
  ending.End(EndReason::kNodeLost, "plant", 5);
  ending.Interrupt(9);
  EXPECT_EQ(ending.reason(), EndReason::kInterrupted);
  EXPECT_EQ(ending.end_ns(), 5);
}

}  // namespace
}  // namespace tiltproof::harness
