#include "harness/terminal/terminal.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

namespace tiltproof::harness {
namespace {

struct Case {
  std::string_view text, plain;
};

TEST(Plain, LeavesPrintableUtf8AsItIs) {
  for (const std::string_view text :
       {"", "a word", "~ \\x1b {}", "\u00a0", "\u00b5s, \u2264 5 \u00b0", "\u2027\u202f\u2030\u2065\u206a",
        "\xed\x9f\xbf\xee\x80\x80", "\u65e5\u672c", "\U0001F681", "\U0010FFFF"})
    EXPECT_EQ(Plain(text), text);
}

TEST(Plain, ShowsTheBytesOfEverythingElse) {
  using namespace std::string_view_literals;
  const Case cases[] = {
      // C0 and DEL, alone and as escape sequences.
      {"\0"sv, R"(\x00)"},
      {"a\nPASS b\r\tc", R"(a\x0aPASS b\x0d\x09c)"},
      {"\x1f\x7f!", R"(\x1f\x7f!)"},
      {"\x1b[2Jgone", R"(\x1b[2Jgone)"},
      {"\x1b]0;title\x07", R"(\x1b]0;title\x07)"},
      {"\x1b", R"(\x1b)"},
      // C1, as UTF-8 and raw.
      {"\u0080\u009b31m\u009f", R"(\xc2\x80\xc2\x9b31m\xc2\x9f)"},
      {"\x9b"
       "31m",
       R"(\x9b31m)"},
      // Overlong: an escape in two, three and four bytes, and the first beyond what is right.
      {"\xc0\x9b", R"(\xc0\x9b)"},
      {"\xc1\xbf", R"(\xc1\xbf)"},
      {"\xe0\x80\x9b", R"(\xe0\x80\x9b)"},
      {"\xe0\x9f\xbf", R"(\xe0\x9f\xbf)"},
      {"\xf0\x80\x80\x9b", R"(\xf0\x80\x80\x9b)"},
      {"\xf0\x8f\xbf\xbf", R"(\xf0\x8f\xbf\xbf)"},
      // Surrogates, beyond U+10FFFF, bytes that never occur.
      {"\xed\xa0\x80", R"(\xed\xa0\x80)"},
      {"\xed\xbf\xbf", R"(\xed\xbf\xbf)"},
      {"\xf4\x90\x80\x80", R"(\xf4\x90\x80\x80)"},
      {"\xf5\x80\x80\x80", R"(\xf5\x80\x80\x80)"},
      {"\xfe\xff", R"(\xfe\xff)"},
      // Truncated, at the end and before other text, which stays.
      {"\xc2", R"(\xc2)"},
      {"\xe2\x82", R"(\xe2\x82)"},
      {"\xf0\x9f\x9a", R"(\xf0\x9f\x9a)"},
      {"\xc2\x1b[2J", R"(\xc2\x1b[2J)"},
      {"\xe2\x82"
       "a\u00b5",
       "\\xe2\\x82"
       "a\u00b5"},
      {"\xf0\x9f\u00b5", "\\xf0\\x9f\u00b5"},
      {"\x80\xbf", R"(\x80\xbf)"},
      // The direction of writing, and line breaks of Unicode.
      {"\u202a\u202e", R"(\xe2\x80\xaa\xe2\x80\xae)"},
      {"\u2066\u2069", R"(\xe2\x81\xa6\xe2\x81\xa9)"},
      {"\u200e\u200f\u061c", R"(\xe2\x80\x8e\xe2\x80\x8f\xd8\x9c)"},
      {"\u2028\u2029", R"(\xe2\x80\xa8\xe2\x80\xa9)"},
  };
  for (const Case& c : cases) {
    EXPECT_EQ(Plain(c.text), c.plain);
    EXPECT_EQ(Plain(Plain(c.text)), c.plain);
  }
}

template <class... Args>
std::string Printed(fmt::format_string<internal::PrintableOf<Args>...> format, const Args&... args) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), std::fclose);
  Print(file.get(), format, args...);
  std::rewind(file.get());
  std::string text(1000, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), file.get()));
  return text;
}

TEST(Print, CleansEveryTextAndKeepsItsOwnFormat) {
  const std::string text = "a\x1b[1m\n";
  const std::string_view view = text;
  EXPECT_EQ(Printed("\x1b[31m{}\t{}\t{}\n", text, view, text.c_str()),
            "\x1b[31ma\\x1b[1m\\x0a\ta\\x1b[1m\\x0a\ta\\x1b[1m\\x0a\n");
  EXPECT_EQ(Printed("{:<6}|{:>4}|{:.1f}|{}\n", "\x1b", 7, 0.25, true), "\\x1b  |   7|0.2|true\n");
}

TEST(Print, KeepsLinesAndWhatIsOurs) {
  EXPECT_EQ(Printed("{}\n", TextLines("one\n\ttwo\r\x1b[2J\u202e")),
            "one\n\ttwo\\x0d\\x1b[2J\\xe2\\x80\\xae\n");
  EXPECT_EQ(Printed("{}\n", OfOurs("\x1b[31mred\x1b[0m")), "\x1b[31mred\x1b[0m\n");
}

}  // namespace
}  // namespace tiltproof::harness
