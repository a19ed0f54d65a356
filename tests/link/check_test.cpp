#include "link/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace tiltproof
