// The minimiser against all subsets of short lists.
#include "harness/campaign/minimise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "faults/random.h"

namespace tiltproof::harness {
namespace {

using List = std::vector<int>;

std::uint32_t MaskOf(const List& list) {
  std::uint32_t mask = 0;
  for (const int place : list) mask |= 1U << place;
  return mask;
}

List Whole(int size) {
  List list(static_cast<std::size_t>(size));
  std::iota(list.begin(), list.end(), 0);
  return list;
}

// Where more of a list that fails always fails, one smallest list is what a search of all subsets finds.
TEST(Minimise, FindsTheOneCauseThatAllSubsetsShow) {
  faults::Random random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const int size = 1 + static_cast<int>(random.Below(12));
    const auto cause = static_cast<std::uint32_t>(random.Below((1U << size) - 1) + 1);
    std::size_t tests_count = 0;
    const auto fails = [&](const List& list) {
      ++tests_count;
      return (MaskOf(list) & cause) == cause;
    };
    const List found = Minimise<int>(Whole(size), fails, {.tests_max = 10'000});
    std::uint32_t smallest = (1U << size) - 1;
    for (std::uint32_t subset = 1; subset < 1U << size; ++subset)
      if ((subset & cause) == cause && std::popcount(subset) < std::popcount(smallest)) smallest = subset;
    EXPECT_EQ(MaskOf(found), smallest);
    EXPECT_LE(tests_count, 300U);
  }
}

// Predicates without any order: the result fails, keeps the list's order, and no element alone can be left out of it.
TEST(Minimise, NothingMoreCanBeLeftOutAlone) {
  faults::Random random(2);
  for (int trial = 0; trial < 300; ++trial) {
    const int size = 2 + static_cast<int>(random.Below(9));
    std::vector<bool> table(std::size_t{1} << size);
    for (auto&& entry : table) entry = random.Below(3) == 0;
    table.back() = true;
    const auto fails = [&](const List& list) { return bool{table[MaskOf(list)]}; };
    const List found = Minimise<int>(Whole(size), fails, {.tests_max = 100'000});
    ASSERT_FALSE(found.empty());
    EXPECT_TRUE(fails(found));
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    for (std::size_t i = 0; i < found.size() && found.size() > 1; ++i) {
      List without = found;
      without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
      EXPECT_FALSE(fails(without)) << "trial " << trial;
    }
  }
}

TEST(Minimise, StopsWhereItMayTestNoMore) {
  std::size_t tests_count = 0;
  const auto fails = [&](const List& list) {
    ++tests_count;
    return list.size() >= 3;
  };
  const List found = Minimise<int>(Whole(100), fails, {.tests_max = 5});
  EXPECT_EQ(tests_count, 5U);
  EXPECT_GE(found.size(), 3U);
  EXPECT_EQ(Minimise<int>(Whole(4), fails, {.tests_max = 0}), Whole(4));
  EXPECT_TRUE(Minimise<int>({}, fails, {.tests_max = 5}).empty());
}

}  // namespace
}  // namespace tiltproof::harness
