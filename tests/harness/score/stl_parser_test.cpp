#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "harness/score/stl.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness::stl {
namespace {

const std::vector<std::string> kNamedFaults = {"bursts", "wind-1"};

std::string Canonical(const std::string& text) {
  return ToString(testing::ParseCriterion(text, kNamedFaults));
}

TEST(StlParser, BindsAsTheGrammarSays) {
  EXPECT_EQ(Canonical("x_m<=1"), "x_m <= 1");
  EXPECT_EQ(Canonical("true or false and not true"), "(true or (false and not (true)))");
  EXPECT_EQ(Canonical("true and true and true"), "((true and true) and true)");
  EXPECT_EQ(Canonical("true implies false implies true or false"),
            "(true implies (false implies (true or false)))");
  EXPECT_EQ(Canonical("not x_m <= 1 and true"), "(not (x_m <= 1) and true)");
  EXPECT_EQ(Canonical("x_m - y_m - 1 < z_m"), "((x_m - y_m) - 1) < z_m");
  EXPECT_EQ(Canonical("x_m + y_m * 2 / 3 >= -x_m"), "(x_m + ((y_m * 2) / 3)) >= -x_m");
  EXPECT_EQ(Canonical("-x_m * 2 > - - 1"), "(-x_m * 2) > --1");
  EXPECT_EQ(Canonical("(true) until[0,1] (false) and true"), "(((true) until[0,1] (false)) and true)");
}

TEST(StlParser, TellsParenthesesOfNumbersFromThoseOfFormulas) {
  EXPECT_EQ(Canonical("((x_m)) <= 1"), "x_m <= 1");
  EXPECT_EQ(Canonical("((x_m + 1) * 2 <= 1)"), "((x_m + 1) * 2) <= 1");
  EXPECT_EQ(Canonical("((x_m <= 1) and ((y_m) > (2)))"), "(x_m <= 1 and y_m > 2)");
  EXPECT_EQ(Canonical("not (x_m) <= 1"), "not (x_m <= 1)");
}

TEST(StlParser, ReadsWindowsNumbersCallsAndSpace) {
  EXPECT_EQ(Canonical(" always [ 5 , 60 ]\n( position_error_m <= 1.0 ) "),
            "always[5,60](position_error_m <= 1)");
  EXPECT_EQ(Canonical("eventually(tilt_rad<0.5e-1)"), "eventually(tilt_rad < 0.05)");
  EXPECT_EQ(Canonical("always[0.0119999999,1e6](true)"), "always[0.012,1e+06](true)");
  EXPECT_EQ(Canonical("max(min(x_m,2.5E+2),.5)>abs(5.)"), "max(min(x_m, 250), 0.5) > abs(5)");
  EXPECT_EQ(Canonical("fault_active( \"wind-1\" ) implies speed_m_s < 3"),
            "(fault_active(\"wind-1\") implies speed_m_s < 3)");
  EXPECT_EQ(Canonical("active_bursts <= 0 and sensed_x_m < 1 and to_plant_frames_sent_count > 1"),
            "((active_bursts <= 0 and sensed_x_m < 1) and to_plant_frames_sent_count > 1)");
}

struct Mistake {
  std::string text;
  std::size_t column;
  std::string message;
};

void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.text; }

class StlParserMistake : public ::testing::TestWithParam<Mistake> {};

TEST_P(StlParserMistake, IsNamedWithItsColumn) {
  const Mistake& mistake = GetParam();
  try {
    testing::ParseCriterion(mistake.text, kNamedFaults);
    FAIL() << "accepted: " << mistake.text;
  } catch (const ParseError& error) {
    EXPECT_EQ(error.what(), mistake.message);
    EXPECT_EQ(error.column, mistake.column) << mistake.text;
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, StlParserMistake,
    ::testing::Values(
        Mistake{"", 1, "expected a number, a signal or a formula, found the end of the formula"},
        Mistake{"  ", 3, "expected a number, a signal or a formula, found the end of the formula"},
        Mistake{"x_m", 4, "expected a comparison (<=, <, >= or >), found the end of the formula"},
        Mistake{"x_m == 1", 5, "expected a comparison (<=, <, >= or >), found '='"},
        Mistake{"x_m and y_m < 1", 5, "expected a comparison (<=, <, >= or >), found 'and'"},
        Mistake{"always(x_m)", 11, "expected a comparison (<=, <, >= or >), found ')'"},
        Mistake{"true and x_m", 13, "expected a comparison (<=, <, >= or >), found the end of the formula"},
        Mistake{"x_m <= ", 8, "expected a number, a signal or a formula, found the end of the formula"},
        Mistake{"x_m <= 1 <= 2", 10, "comparisons do not chain: write 'a <= b and b <= c'"},
        Mistake{"x_m <= 1 y_m", 10, "expected 'and', 'or', 'implies' or the end of the formula, found 'y_m'"},
        Mistake{"x_m <= 1)", 9, "expected 'and', 'or', 'implies' or the end of the formula, found ')'"},
        Mistake{"(x_m <= 1", 10, "expected ')', found the end of the formula"},
        Mistake{"(true) <= 1", 1, "expected a number to compare, found a formula"},
        Mistake{"x_m <= (true)", 8, "expected a number, found a formula"},
        Mistake{"1 + (true) <= 1", 5, "expected a number, found a formula"},
        Mistake{"(true) * 2 <= 1", 1, "expected a number, found a formula"},
        Mistake{"-(true) <= 1", 2, "expected a number, found a formula"},
        Mistake{"abs((true)) <= 1", 5, "expected a number, found a formula"},
        Mistake{"x_m <= not true", 8, "expected a number, a signal or a formula, found 'not'"},
        Mistake{
            "position_eror_m <= 1", 1,
            "unknown signal 'position_eror_m'; did you mean 'position_error_m'? all signals: tiltproof list "
            "--signals"},
        Mistake{"always(X_m <= 1)", 8,
                "unknown signal 'X_m'; did you mean 'x_m'? all signals: tiltproof list --signals"},
        Mistake{"quite_something_else <= 1", 1,
                "unknown signal 'quite_something_else'; all signals: tiltproof list --signals"},
        Mistake{"active_wind < 1", 1, "unknown signal 'active_wind'; all signals: tiltproof list --signals"},
        Mistake{"alway(x_m <= 1)", 1, "unknown operator 'alway'; did you mean 'always'?"},
        Mistake{"eventualy[0,1](x_m <= 1)", 1, "unknown operator 'eventualy'; did you mean 'eventually'?"},
        Mistake{"sqrt(x_m) <= 1", 1, "unknown operator 'sqrt'"},
        Mistake{"always x_m <= 1", 8, "expected '[' or '(', found 'x_m'"},
        Mistake{"always[0,1] x_m <= 1", 13, "expected '(', found 'x_m'"},
        Mistake{"always[5,2](true)", 7, "the window ends before it begins"},
        Mistake{"always[-1,2](true)", 8, "a window lies in the future: its bounds are not negative"},
        Mistake{"always[0,-2](true)", 10, "a window lies in the future: its bounds are not negative"},
        Mistake{"always[0,2e6](true)", 10, "a window reaches at most 1000000 s ahead"},
        Mistake{"always[0,x_m](true)", 10, "expected a number of seconds, found 'x_m'"},
        Mistake{"always[0](true)", 9, "expected ',', found ']'"},
        Mistake{"always[0,1(true)", 11, "expected ']', found '('"},
        Mistake{"(true) until (true)", 14, "expected '[', found '('"},
        Mistake{"true until[0,1] (true)", 6,
                "expected 'and', 'or', 'implies' or the end of the formula, found 'until'"},
        Mistake{"(true) until[0,1] true", 19, "expected '(', found 'true'"},
        Mistake{"fault_active(bursts)", 14, "expected a fault's id in double quotes, found 'bursts'"},
        Mistake{"fault_active(\"burst\")", 14, "the scenario has no fault 'burst'; did you mean 'bursts'?"},
        Mistake{"fault_active(\"bursts)", 14, "the text's closing '\"' is missing"},
        Mistake{"x_m <= 1e999", 8, "the number 1e999 is too large or too small for binary64"},
        Mistake{"x_m <= 1e-999", 8, "the number 1e-999 is too large or too small for binary64"},
        Mistake{"x_m <= 0.6rad", 11, "the number 0.6 runs into 'r'"},
        Mistake{"x_m <= 1.2.3", 11, "the number 1.2 runs into '.'"},
        Mistake{"x_m <= inf", 8, "unknown signal 'inf'; all signals: tiltproof list --signals"},
        Mistake{"min(x_m) <= 1", 8, "expected ',', found ')'"},
        Mistake{"x_m \xE2\x89\xA4 1", 5, "expected a comparison (<=, <, >= or >), found byte 226"},
        Mistake{std::string("x_m <\0 1", 8), 6, "expected a number, a signal or a formula, found byte 0"}));

TEST(StlParser, LimitsNestingAndLength) {
  const auto nested = [](std::size_t levels) {
    return std::string(levels, '(') + "x_m <= 1" + std::string(levels, ')');
  };
  EXPECT_EQ(Canonical(nested(kNestingMax_count - 1)), "x_m <= 1");  // the signal is a level of its own
  for (const std::string prefix : {"(", "-", "not ", "true implies ", "always(", "abs("}) {
    std::string text;
    for (std::size_t i = 0; i <= kNestingMax_count; ++i) text += prefix;
    try {
      testing::ParseCriterion(text, kNamedFaults);
      FAIL() << prefix;
    } catch (const ParseError& error) {
      EXPECT_STREQ(error.what(), "nested deeper than 64 levels") << prefix;
    }
  }
  std::string text = "x_m <= 1";
  while (text.size() + 14 <= kFormulaLengthMax_bytes) text += " and x_m <= 1 ";
  text.resize(kFormulaLengthMax_bytes, ' ');
  EXPECT_NE(testing::ParseCriterion(text, kNamedFaults), nullptr);
  try {
    testing::ParseCriterion(text + " ", kNamedFaults);
    FAIL();
  } catch (const ParseError& error) {
    EXPECT_STREQ(error.what(), "a formula has at most 4096 bytes");
    EXPECT_EQ(error.column, kFormulaLengthMax_bytes + 1);
  }
}

}  // namespace
}  // namespace tiltproof::harness::stl
