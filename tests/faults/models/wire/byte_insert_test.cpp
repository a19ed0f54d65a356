#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(ByteInsertTest, AddsRandomBytesAtItsRate) {
  const auto out = Send(Spec("wire.byte_insert", {{"probability", 0.05}}), 5000);
  double added = 0, sum = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const Bytes before = Frame(static_cast<std::int64_t>(n)).bytes;
    const Bytes& after = out[n].at(0).bytes;
    // What was sent is still there in order; greedily matched, the rest was inserted.
    std::size_t next = 0;
    for (const std::uint8_t byte : after) {
      if (next < before.size() && byte == before[next]) {
        ++next;
      } else {
        ++added;
        sum += byte;
      }
    }
    ASSERT_EQ(next, before.size());
    EXPECT_EQ(after.back(), 0x7E);
  }
  EXPECT_NEAR(added, 0.05 * 68 * 5000, 5 * std::sqrt(0.05 * 68 * 5000));
  EXPECT_NEAR(sum / added, 127.5, 5 * 74.0 / std::sqrt(added));
}

}  // namespace
}  // namespace tiltproof::faults
