#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(SilenceTest, FramesBegunInTheWindowVanishWhole) {
  FaultSpec spec = Spec("link.silence");
  spec.target = Target::kNone;
  // Opens within frame 3, closes within frame 6.
  spec.start_ns = FrameTime(3) + 100'000;
  spec.end_ns = FrameTime(6) + 100'000;
  for (const link::Direction direction : {link::Direction::kToClient, link::Direction::kToPlant}) {
    FaultSchedule schedule = AtTheLine({spec}, 1);
    const auto out = Send(schedule, 10, 68, direction);
    for (std::int64_t n = 0; n < 10; ++n) {
      const auto& chunks = out[static_cast<std::size_t>(n)];
      if (n >= 4 && n <= 6) {
        EXPECT_TRUE(chunks.empty()) << n;
      } else {
        EXPECT_TRUE(Unchanged(chunks, n)) << n;
      }
    }
  }
}

TEST(SilenceTest, TheReferenceLineGoesOn) {
  FaultSpec spec = Spec("link.silence");
  spec.target = Target::kNone;
  FaultSchedule schedule = AtTheLine({spec}, 1);
  EXPECT_EQ(schedule.Filter(link::Direction::kReference), nullptr);
}

}  // namespace
}  // namespace tiltproof::faults
