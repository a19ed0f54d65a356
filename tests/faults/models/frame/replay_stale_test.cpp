#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(ReplayStaleTest, PutsTheFrameOfThatAgeInPlace) {
  const auto out = Send(Spec("frame.replay_stale", {{"probability", 0.4}, {"age_count", 3.0}}), 100'000);
  std::vector<bool> replayed;
  for (std::int64_t n = 0; n < 100'000; ++n) {
    const auto& chunks = out[static_cast<std::size_t>(n)];
    ASSERT_EQ(chunks.size(), 1U);
    EXPECT_EQ(chunks[0].begin_ns, Frame(n).begin_ns);
    const bool is_old = chunks[0].bytes != Frame(n).bytes;
    if (n >= 3) replayed.push_back(is_old);
    if (!is_old) continue;
    ASSERT_GE(n, 3);
    // The frame as it was sent then, though it may have been replaced itself.
    ASSERT_EQ(chunks[0].bytes, Frame(n - 3).bytes);
  }
  EXPECT_TRUE(AreBernoulli(replayed, 0.4));
}

TEST(ReplayStaleTest, RemembersFramesBeforeTheWindow) {
  FaultSpec spec = Spec("frame.replay_stale", {{"probability", 1.0}, {"age_count", 10.0}});
  spec.start_ns = FrameTime(50);
  spec.end_ns = FrameTime(51);
  const auto out = Send(spec, 60);
  EXPECT_EQ(CountUnchanged(out), 59);
  EXPECT_EQ(out[50].at(0).bytes, Frame(40).bytes);
}

TEST(ReplayStaleTest, ReplaysTheSameMessage) {
  FaultSpec spec = Spec("frame.replay_stale", {{"probability", 1.0}, {"age_count", 1.0}});
  spec.target = Target::kToPlant;
  FaultSchedule schedule = AtTheLine({spec}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  for (std::int64_t n = 0; n < 20; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    chunks[0].message = PlaceInPaper(n % 2 == 0 ? "request" : "actuators");
    schedule.Filter(link::Direction::kToPlant)->Apply(chunks);
    EXPECT_EQ(chunks.at(0).bytes, Frame(n < 2 ? n : n - 2).bytes) << n;
  }
}

}  // namespace
}  // namespace tiltproof::faults
