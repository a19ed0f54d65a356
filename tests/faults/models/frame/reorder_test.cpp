#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

// Numbers of the frames in the order in which they came out.
std::vector<std::uint64_t> Order(const std::vector<std::vector<link::Chunk>>& out) {
  std::vector<std::uint64_t> order;
  for (const auto& chunks : out) {
    for (const auto& chunk : chunks) {
      EXPECT_EQ(chunk.bytes, Frame(static_cast<std::int64_t>(chunk.number)).bytes);
      order.push_back(chunk.number);
    }
  }
  return order;
}

TEST(ReorderTest, LetsDepthLaterFramesPass) {
  FaultSpec spec = Spec("frame.reorder", {{"probability", 1.0}, {"depth_count", 2.0}});
  spec.every_nth_count = 5;
  EXPECT_THAT(Order(Send(spec, 12)), ::testing::ElementsAre(0, 1, 2, 3, 5, 6, 4, 7, 8, 10, 11, 9));
}

TEST(ReorderTest, HeldFramesGoOnAfterTheWindow) {
  FaultSpec spec = Spec("frame.reorder", {{"probability", 1.0}, {"depth_count", 3.0}});
  spec.start_ns = FrameTime(1);
  spec.end_ns = FrameTime(3);
  EXPECT_THAT(Order(Send(spec, 8)), ::testing::ElementsAre(0, 3, 4, 1, 5, 2, 6, 7));
}

TEST(ReorderTest, ADepthOfOneSwapsNeighbours) {
  FaultSpec spec = Spec("frame.reorder", {{"probability", 1.0}, {"depth_count", 1.0}});
  spec.every_nth_count = 2;
  EXPECT_THAT(Order(Send(spec, 7)), ::testing::ElementsAre(0, 2, 1, 4, 3, 6, 5));
}

TEST(ReorderTest, LosesNothingButWhatIsHeldAtTheEnd) {
  const auto out = Send(Spec("frame.reorder", {{"probability", 0.3}, {"depth_count", 4.0}}), 100'000);
  auto order = Order(out);
  EXPECT_GE(order.size(), 99'996U);
  std::vector<bool> held;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const auto& chunks = out[n];
    held.push_back(
        std::none_of(chunks.begin(), chunks.end(), [n](const auto& chunk) { return chunk.number == n; }));
  }
  EXPECT_TRUE(AreBernoulli(held, 0.3));
  std::sort(order.begin(), order.end());
  EXPECT_EQ(std::adjacent_find(order.begin(), order.end()), order.end());
}

TEST(ReorderTest, OtherMessagesDoNotCount) {
  FaultSpec spec = Spec("frame.reorder", {{"probability", 1.0}, {"depth_count", 1.0}});
  spec.target = Target::kToPlant;
  spec.message = "actuators";
  spec.end_ns = 1;  // frame 0 only
  FaultSchedule schedule = AtTheLine({spec}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<std::uint64_t> order;
  for (std::int64_t n = 0; n < 5; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    chunks[0].message = PlaceInPaper(n % 3 == 0 ? "actuators" : "request");
    schedule.Filter(link::Direction::kToPlant)->Apply(chunks);
    for (const auto& chunk : chunks) order.push_back(chunk.number);
  }
  EXPECT_THAT(order, ::testing::ElementsAre(1, 2, 3, 0, 4));
}

}  // namespace
}  // namespace tiltproof::faults
