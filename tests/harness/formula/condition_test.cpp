#include "harness/formula/condition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace tiltproof::harness::stl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<std::string> kSignals = {"z_m", "speed_m_s", "roll_rad"};

bool Holds(const std::string& text, const std::map<std::string, double, std::less<>>& row) {
  return Condition(text, kSignals).Holds([&](std::string_view signal) { return row.find(signal)->second; });
}

TEST(ConditionTest, ComparesTheValuesOfOneRow) {
  for (const double z : {-2.0, 0.0, 1.0, 1.5, 2.0, 3.0}) {
    for (const double v : {0.0, 1.0, 4.0}) {
      const std::map<std::string, double, std::less<>> row = {{"z_m", z}, {"speed_m_s", v}};
      EXPECT_EQ(Holds("z_m > 1", row), z > 1);
      EXPECT_EQ(Holds("z_m >= 1", row), z >= 1);
      EXPECT_EQ(Holds("z_m < 1", row), z < 1);
      EXPECT_EQ(Holds("z_m <= 1", row), z <= 1);
      EXPECT_EQ(Holds("z_m > 1 and not (speed_m_s < 2 or z_m > 2)", row), z > 1 && !(v < 2 || z > 2));
      EXPECT_EQ(Holds("z_m > 1 implies speed_m_s > 2", row), !(z > 1) || v > 2);
      EXPECT_EQ(Holds("abs(z_m) - min(speed_m_s, 2) * 2 > -z_m / 3", row),
                std::abs(z) - std::min(v, 2.0) * 2 > -z / 3);
      EXPECT_TRUE(Holds("true", row));
      EXPECT_FALSE(Holds("false", row));
    }
  }
}

TEST(ConditionTest, AComparisonWithNaNIsFalse) {
  const std::map<std::string, double, std::less<>> row = {{"z_m", std::nan("")}, {"speed_m_s", 1.0}};
  for (const char* text : {"z_m > 1", "z_m <= 1", "max(z_m, speed_m_s) >= 0", "z_m >= z_m"})
    EXPECT_FALSE(Holds(text, row)) << text;
  EXPECT_TRUE(Holds("speed_m_s > 0 or z_m > 1", row));
  EXPECT_TRUE(Holds("not (z_m > 1)", row));
}

TEST(ConditionTest, NamesItsSignals) {
  EXPECT_THAT(Condition("z_m > 1 and abs(roll_rad) < z_m", kSignals).Signals(),
              ElementsAre("z_m", "roll_rad"));
}

void Refused(const std::string& text, std::size_t column, const std::string& why) {
  try {
    Condition(text, kSignals);
    ADD_FAILURE() << text;
  } catch (const ParseError& error) {
    EXPECT_EQ(error.column, column) << text;
    EXPECT_THAT(error.what(), HasSubstr(why)) << text;
  }
}

TEST(ConditionTest, RefusesWhatNeedsMoreThanARow) {
  Refused("z_m > 1 and always[0,1](z_m > 0)", 13, "'always' looks at more than one row");
  Refused("eventually(z_m > 0)", 1, "'eventually' looks");
  Refused("(z_m > 1) until[0,1] (z_m < 0)", 11, "'until' looks");
  Refused("not fault_active(\"x\")", 5, "'fault_active' looks");
  Refused("z_mm > 1", 1, "did you mean 'z_m'?");
  Refused("active_x > 0", 1, "unknown signal 'active_x'");
}

}  // namespace
}  // namespace tiltproof::harness::stl
