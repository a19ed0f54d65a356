#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(DuplicateTest, ACopyFollowsDirectly) {
  const auto out = Send(Spec("frame.duplicate", {{"probability", 0.3}}), 10'000);
  int doubled = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const link::Chunk frame = Frame(static_cast<std::int64_t>(n));
    ASSERT_TRUE(Same(out[n].at(0), frame));
    if (out[n].size() == 1) continue;
    ASSERT_EQ(out[n].size(), 2U);
    EXPECT_EQ(out[n][1].bytes, frame.bytes);
    EXPECT_EQ(out[n][1].begin_ns, frame.begin_ns + 68 * 10 * kNsPerS / 921'600);
    ++doubled;
  }
  EXPECT_NEAR(doubled, 3000, 230);
}

}  // namespace
}  // namespace tiltproof::faults
