#include <gtest/gtest.h>

#include <algorithm>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(TruncateTest, KeepsTheBeginningEveryLengthAlike) {
  const auto out = Send(Spec("frame.truncate", {{"probability", 0.8}}), 130'000);
  std::vector<bool> cut;
  std::vector<double> by_length(67, 0);  // of 1 to 67 bytes
  for (std::size_t n = 0; n < out.size(); ++n) {
    const Bytes before = Frame(static_cast<std::int64_t>(n)).bytes;
    const Bytes& after = out[n].at(0).bytes;
    cut.push_back(after.size() != before.size());
    if (!cut.back()) continue;
    ASSERT_GE(after.size(), 1U);
    ASSERT_TRUE(std::equal(after.begin(), after.end(), before.begin()));
    ++by_length.at(after.size() - 1);
  }
  EXPECT_TRUE(AreBernoulli(cut, 0.8));
  EXPECT_TRUE(AreUniform(by_length));
}

}  // namespace
}  // namespace tiltproof::faults
