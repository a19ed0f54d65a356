#include "harness/dds/sequence_filter.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>

namespace tiltproof::dds {
namespace {

// Against a plain set of what came.
TEST(SequenceFilterTest, PassesEachOnceAndKnowsTheHoles) {
  std::mt19937 engine(3);
  for (int round = 0; round < 300; ++round) {
    SequenceFilter filter;
    std::set<std::int64_t> came;
    const auto range = 1 + engine() % 40;
    for (unsigned i = 0; i < 60; ++i) {
      const auto sequence = static_cast<std::int64_t>(1 + engine() % range);
      ASSERT_EQ(filter.Pass("run", "node", sequence), came.insert(sequence).second);
      std::int64_t complete = 0;
      while (came.contains(complete + 1)) ++complete;
      ASSERT_EQ(filter.CompleteUpTo("run", "node"), complete);
      std::set<std::int64_t> missing;
      for (std::int64_t s = 1; s < *came.rbegin(); ++s) {
        if (!came.contains(s)) missing.insert(s);
      }
      std::set<std::int64_t> in_gaps;
      for (const auto& gap : filter.Gaps()) {
        ASSERT_LE(gap.first, gap.last);
        for (auto s = gap.first; s <= gap.last; ++s) ASSERT_TRUE(in_gaps.insert(s).second);
      }
      ASSERT_EQ(in_gaps, missing);
    }
  }
}

TEST(SequenceFilterTest, CountsEachLogOnItsOwn) {
  SequenceFilter filter;
  EXPECT_TRUE(filter.Pass("a", "x", 1));
  EXPECT_TRUE(filter.Pass("a", "y", 1));
  EXPECT_TRUE(filter.Pass("b", "x", 3));
  EXPECT_FALSE(filter.Pass("a", "x", 1));
  EXPECT_EQ(filter.Gaps(), (std::vector<SequenceGap>{{"b", "x", 1, 2}}));
  EXPECT_EQ(filter.CompleteUpTo("a", "y"), 1);
  EXPECT_EQ(filter.CompleteUpTo("b", "x"), 0);
  EXPECT_EQ(filter.CompleteUpTo("nobody", "x"), 0);
}

TEST(SequenceFilterTest, RefusesWhatIsNoSequence) {
  SequenceFilter filter;
  for (const std::int64_t sequence :
       {std::int64_t{0}, std::int64_t{-1}, std::numeric_limits<std::int64_t>::min(),
        std::numeric_limits<std::int64_t>::max()}) {
    EXPECT_FALSE(filter.Pass("run", "node", sequence));
  }
  EXPECT_TRUE(filter.Gaps().empty());
}

TEST(SequenceFilterTest, KeepsABoundedNumberOfHoles) {
  SequenceFilter filter;
  const auto limit = static_cast<std::int64_t>(SequenceFilter::kHolesCountMax);
  for (std::int64_t i = 1; i <= limit + 100; ++i) filter.Pass("run", "node", 2 * i);
  EXPECT_LE(filter.Gaps().size(), SequenceFilter::kHolesCountMax + 1);
  EXPECT_TRUE(filter.Pass("run", "node", 1));  // closing one is still possible
  EXPECT_EQ(filter.CompleteUpTo("run", "node"), 2);
}

}  // namespace
}  // namespace tiltproof::dds
