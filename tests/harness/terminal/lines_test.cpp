#include "harness/terminal/lines.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "harness/terminal/progress_line.h"

namespace tiltproof::harness {
namespace {

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// As a person puts the lines together again; each but the last ends in `end_size` bytes that are not the text's.
std::string Joined(const std::string& text, std::size_t indent, std::size_t end_size) {
  std::string joined;
  for (const std::string& line : LinesOf(text)) {
    if (!joined.empty()) joined.resize(joined.size() - end_size);
    joined += (joined.empty() ? "" : " ") + line.substr(indent);
  }
  return joined;
}

TEST(InLines, KeepsEveryWordAndNoLineIsTooLong) {
  std::string text;
  for (int i = 0; i < 60; ++i)
    text += std::string(static_cast<std::size_t>(1 + (i * 7) % 13), static_cast<char>('a' + i % 26)) + " ";
  text += "end";
  for (const std::size_t indent : {0, 6, 17}) {
    for (const std::size_t columns : {40, 79, 80, 81}) {
      const std::string lines = InLines(text, indent, columns);
      EXPECT_EQ(Joined(lines, indent, 0), text);
      const std::vector<std::string> each = LinesOf(lines);
      for (std::size_t i = 0; i < each.size(); ++i) {
        EXPECT_LE(each[i].size(), columns);
        EXPECT_EQ(each[i].substr(0, indent), std::string(indent, ' '));
        // Not shorter than it must be: the next word would not have fitted.
        if (i + 1 == each.size()) continue;
        const std::string next = each[i + 1].substr(indent);
        EXPECT_GT(each[i].size() + 1 + next.substr(0, next.find(' ')).size(), columns);
      }
    }
  }
}

TEST(InLines, CountsCharactersAndKeepsLongWordsWhole) {
  EXPECT_EQ(InLines("\u00b5\u00b5\u00b5 \u00b5\u00b5", 0, 6), "\u00b5\u00b5\u00b5 \u00b5\u00b5");
  EXPECT_EQ(InLines("see /a/path/that/is/long now", 2, 10), "  see\n  /a/path/that/is/long\n  now");
  EXPECT_EQ(InLines("a\nb", 1, 80), " a\\x0ab");
  EXPECT_EQ(InLines("", 3, 80), "   ");
}

TEST(CommandInLines, IsOneCommandForAShell) {
  const std::string command =
      "tiltproof run a.yaml --client 'process:./mine {port} -v' --mode realtime --seed 7";
  const std::string lines = CommandInLines(command, 4, 30);
  EXPECT_EQ(Joined(lines, 4, 2), command);
  for (const std::string& line : LinesOf(lines))
    EXPECT_TRUE(line.size() <= 30 || line.find('\'') != std::string::npos) << line;
  EXPECT_NE(lines.find("'process:./mine {port} -v' \\\n"), std::string::npos) << lines;
}

TEST(TimeLeft, IsInProportion) {
  EXPECT_FALSE(TimeLeft(0.0, 100.0));
  EXPECT_FALSE(TimeLeft(0.5, 0.1));
  EXPECT_DOUBLE_EQ(TimeLeft(0.25, 30.0).value_or(-1), 90.0);
  EXPECT_DOUBLE_EQ(TimeLeft(1.0, 30.0).value_or(-1), 0.0);
}

TEST(DurationText, RoundsUp) {
  const std::pair<double, const char*> cases[] = {
      {-3.0, "0 s"},           {0.0, "0 s"},          {0.2, "1 s"},
      {59.0, "59 s"},          {59.5, "1 min 0 s"},   {125.0, "2 min 5 s"},
      {3599.0, "59 min 59 s"}, {3600.0, "1 h 0 min"}, {4201.0, "1 h 11 min"}};
  for (const auto& [seconds, text] : cases) EXPECT_EQ(DurationText(seconds), text) << seconds;
}

}  // namespace
}  // namespace tiltproof::harness
