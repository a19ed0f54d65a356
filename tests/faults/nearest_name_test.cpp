#include "faults/nearest_name.h"

#include <gtest/gtest.h>

#include <vector>

namespace tiltproof::faults {
namespace {

TEST(NearestNameTest, DistanceCountsEdits) {
  EXPECT_EQ(EditDistance("", ""), 0U);
  EXPECT_EQ(EditDistance("ber", "ber"), 0U);
  EXPECT_EQ(EditDistance("", "ber"), 3U);
  EXPECT_EQ(EditDistance("kitten", "sitting"), 3U);
  EXPECT_EQ(EditDistance("p_bda", "p_bad"), 1U);
  EXPECT_EQ(EditDistance("sitting", "kitten"), 3U);
}

TEST(NearestNameTest, FindsTheClosestOrNone) {
  const std::vector<std::string_view> names = {"wire.burst", "wire.bit_error", "frame.drop"};
  EXPECT_EQ(NearestName("wire.bit_eror", names), "wire.bit_error");
  EXPECT_EQ(NearestName("fram.drop", names), "frame.drop");
  EXPECT_EQ(NearestName("gremlin", names), "");
  EXPECT_EQ(NearestName("x", {}), "");
}

}  // namespace
}  // namespace tiltproof::faults
