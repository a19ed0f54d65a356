#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(ByteInsertTest, AddsRandomBytesAtItsRate) {
  const auto out = Send(Spec("wire.byte_insert", {{"probability", 0.05}}), 5000);
  double added = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const Bytes before = Frame(static_cast<std::int64_t>(n)).bytes;
    const Bytes& after = out[n].at(0).bytes;
    // The sent bytes are still there, in order. The rest, after greedy matching, was inserted.
    std::size_t next = 0;
    for (const std::uint8_t byte : after) {
      if (next < before.size() && byte == before[next]) {
        ++next;
      } else {
        ++added;
      }
    }
    ASSERT_EQ(next, before.size());
    EXPECT_EQ(after.back(), 0x7E);
  }
  EXPECT_NEAR(added, 0.05 * 68 * 5000, 5 * std::sqrt(0.05 * 68 * 5000));
}

TEST(ByteInsertTest, EachPlaceForItselfAndEveryValueAlike) {
  const Bytes before = DistinctBytes();
  std::vector<bool> inserted;
  std::vector<double> by_value(256, 0);
  for (const auto& chunks :
       SendWithoutPause(Spec("wire.byte_insert", {{"probability", 0.1}}), before, 10'000)) {
    const Bytes& after = chunks.at(0).bytes;
    std::size_t next = 0;
    for (const std::uint8_t byte : before) {
      // An inserted byte with the value of the byte before or behind it cannot be told from that byte.
      inserted.push_back(after.at(next) != byte || (next + 1 < after.size() && after[next + 1] == byte));
      if (inserted.back()) ++by_value[after[next++]];
      ASSERT_EQ(after.at(next++), byte);
    }
    ASSERT_EQ(next, after.size());
  }
  EXPECT_TRUE(AreBernoulli(inserted, 0.1));  // some 100 000 of them
  EXPECT_TRUE(AreUniform(by_value));
}

}  // namespace
}  // namespace tiltproof::faults
