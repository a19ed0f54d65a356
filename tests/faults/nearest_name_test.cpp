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

TEST(NearestNameTest, KnowsAbbreviations) {
  const std::vector<std::string_view> names = {"position_error_m", "cross_track_error_m", "roll_rad",
                                               "roll_ref_rad"};
  EXPECT_EQ(NearestName("pos_err", names), "position_error_m");
  EXPECT_EQ(NearestName("cross_error", names), "cross_track_error_m");
  EXPECT_EQ(NearestName("rol", names), "roll_rad");
  EXPECT_EQ(NearestName("error", names), "");
  EXPECT_EQ(NearestName("pos_err_m_s", names), "");
  EXPECT_EQ(NearestName("_", names), "");
  EXPECT_EQ(NearestName("", names), "");
}

}  // namespace
}  // namespace tiltproof::faults
