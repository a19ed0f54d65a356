#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

// Length of the run of equal bytes that begins at `from`.
std::size_t RunLength(const Bytes& bytes, std::size_t from) {
  std::size_t end = from;
  while (end < bytes.size() && bytes[end] == bytes[from]) ++end;
  return end - from;
}

TEST(ByteDuplicateTest, RepeatsAtItsRate) {
  const auto out = Send(Spec("wire.byte_duplicate", {{"probability", 0.05}}), 5000);
  double repeated = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const Bytes before = Frame(static_cast<std::int64_t>(n)).bytes;
    const Bytes& after = out[n].at(0).bytes;
    repeated += static_cast<double>(after.size() - before.size());
    std::size_t i = 0;
    for (std::size_t from = 0; from < before.size(); from += RunLength(before, from)) {
      ASSERT_EQ(after.at(i), before[from]);
      const std::size_t length = RunLength(before, from);
      EXPECT_GE(RunLength(after, i), length);
      EXPECT_LE(RunLength(after, i), 2 * length);
      i += RunLength(after, i);
    }
    ASSERT_EQ(i, after.size());
  }
  EXPECT_NEAR(repeated, 0.05 * 68 * 5000, 5 * std::sqrt(0.05 * 68 * 5000));
}

TEST(ByteDuplicateTest, EachByteIsRepeatedForItself) {
  const Bytes before = DistinctBytes();
  std::vector<bool> repeated;
  for (const auto& chunks :
       SendWithoutPause(Spec("wire.byte_duplicate", {{"probability", 0.1}}), before, 10'000)) {
    const Bytes& after = chunks.at(0).bytes;
    std::size_t next = 0;
    for (const std::uint8_t byte : before) {
      ASSERT_EQ(after.at(next++), byte);
      repeated.push_back(next < after.size() && after[next] == byte);
      if (repeated.back()) ++next;
    }
    ASSERT_EQ(next, after.size());
  }
  EXPECT_TRUE(AreBernoulli(repeated, 0.1));  // some 100 000 of them
}

TEST(ByteDuplicateTest, ProbabilityOneRepeatsEveryByte) {
  const Bytes before = Frame(3).bytes;
  const Bytes after = Send(Spec("wire.byte_duplicate", {{"probability", 1.0}}), 4).at(3).at(0).bytes;
  ASSERT_EQ(after.size(), 2 * before.size());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(after[i], before[i / 2]);
}

}  // namespace
}  // namespace tiltproof::faults
