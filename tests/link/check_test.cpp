#include "link/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <limits>
#include <string>

namespace tiltproof {
namespace {

TEST(Check, ABrokenInvariantNamesItsPlaceAndWhatWasExpected) {
  EXPECT_NO_THROW(Check(true, "two and two are four"));
  const int line = __LINE__ + 2;
  try {
    Check(2 + 2 == 5, "two and two are five");
    FAIL();
  } catch (const BrokenInvariant& error) {
    EXPECT_EQ(error.what(), "broken invariant at tests/link/check_test.cpp:" + std::to_string(line) +
                                ": two and two are five");
  }
}

TEST(Check, AnIndexIsNamedWithItsLimit) {
  EXPECT_NO_THROW(CheckIndex(2, 3, "a fault is known"));
  try {
    CheckIndex(3, 3, "a fault is known");
    FAIL();
  } catch (const BrokenInvariant& error) {
    EXPECT_THAT(error.what(), ::testing::EndsWith(": a fault is known (index 3 of 3)"));
  }
}

TEST(Check, APartIsInsideTheWhole) {
  constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();
  EXPECT_NO_THROW(CheckPart(0, 4, 4, "a number has its bytes"));
  EXPECT_NO_THROW(CheckPart(4, 0, 4, "a number has its bytes"));
  EXPECT_THROW(CheckPart(1, 4, 4, "a number has its bytes"), BrokenInvariant);
  // A sum that wraps is no part.
  EXPECT_THROW(CheckPart(kMost, 1, 4, "a number has its bytes"), BrokenInvariant);
  EXPECT_THROW(CheckPart(1, kMost, 4, "a number has its bytes"), BrokenInvariant);
}

}  // namespace
}  // namespace tiltproof
