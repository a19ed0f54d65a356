#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(TruncateTest, KeepsTheBeginningEveryLengthAlike) {
  const auto out = Send(Spec("frame.truncate", {{"probability", 0.8}}), 20'000);
  double cut = 0;
  std::vector<int> by_length(68, 0);
  for (std::size_t n = 0; n < out.size(); ++n) {
    const Bytes before = Frame(static_cast<std::int64_t>(n)).bytes;
    const Bytes& after = out[n].at(0).bytes;
    if (after.size() == before.size()) continue;
    ASSERT_GE(after.size(), 1U);
    ASSERT_TRUE(std::equal(after.begin(), after.end(), before.begin()));
    ++cut;
    ++by_length.at(after.size());
  }
  EXPECT_NEAR(cut, 16'000, 300);
  const double expected = cut / 67;
  for (std::size_t length = 1; length < 68; ++length) {
    EXPECT_NEAR(by_length[length], expected, 6 * std::sqrt(expected)) << length;
  }
}

}  // namespace
}  // namespace tiltproof::faults
