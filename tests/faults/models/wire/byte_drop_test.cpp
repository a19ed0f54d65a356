#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

// True if `part` is what is left of `whole` when some bytes are taken out.
bool IsSubsequence(const Bytes& part, const Bytes& whole) {
  std::size_t next = 0;
  for (const std::uint8_t byte : whole) next += next < part.size() && part[next] == byte ? 1 : 0;
  return next == part.size();
}

TEST(ByteDropTest, LosesItsShareAndClosesUp) {
  const auto out = Send(Spec("wire.byte_drop", {{"probability", 0.05}}), 5000);
  double lost = 0, flags = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const Bytes before = Frame(static_cast<std::int64_t>(n)).bytes;
    const link::Chunk& after = out[n].at(0);
    ASSERT_TRUE(IsSubsequence(after.bytes, before));
    EXPECT_EQ(after.begin_ns, Frame(static_cast<std::int64_t>(n)).begin_ns);
    lost += static_cast<double>(before.size() - after.bytes.size());
    flags += after.bytes.back() != 0x7E ? 1 : 0;
  }
  EXPECT_NEAR(lost, 0.05 * 68 * 5000, 5 * std::sqrt(0.05 * 68 * 5000));
  EXPECT_NEAR(flags, 250, 80);
}

TEST(ByteDropTest, EachByteIsLostForItself) {
  const Bytes before = DistinctBytes();
  std::vector<bool> lost;
  for (const auto& chunks :
       SendWithoutPause(Spec("wire.byte_drop", {{"probability", 0.1}}), before, 10'000)) {
    const Bytes& after = chunks.at(0).bytes;
    std::size_t next = 0;
    for (const std::uint8_t byte : before) {
      lost.push_back(next == after.size() || after[next] != byte);
      if (!lost.back()) ++next;
    }
    ASSERT_EQ(next, after.size());
  }
  EXPECT_TRUE(AreBernoulli(lost, 0.1));  // some 100 000 of them
}

TEST(ByteDropTest, AFrameThatLosesAllVanishes) {
  EXPECT_TRUE(Send(Spec("wire.byte_drop", {{"probability", 1.0}}), 1).at(0).empty());
}

}  // namespace
}  // namespace tiltproof::faults
