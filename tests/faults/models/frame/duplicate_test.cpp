#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(DuplicateTest, ACopyFollowsDirectly) {
  const auto out = Send(Spec("frame.duplicate", {{"probability", 0.3}}), 100'000);
  std::vector<bool> doubled;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const link::Chunk frame = Frame(static_cast<std::int64_t>(n));
    ASSERT_TRUE(Same(out[n].at(0), frame));
    doubled.push_back(out[n].size() > 1);
    if (!doubled.back()) continue;
    ASSERT_EQ(out[n].size(), 2U);
    EXPECT_EQ(out[n][1].bytes, frame.bytes);
    EXPECT_EQ(out[n][1].begin_ns, frame.begin_ns + 68 * 10 * kNsPerS / 921'600);
  }
  EXPECT_TRUE(AreBernoulli(doubled, 0.3));
}

}  // namespace
}  // namespace tiltproof::faults
