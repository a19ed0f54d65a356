#include "harness/scenario/yaml_tree.h"

#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <vector>

namespace tiltproof::harness {
namespace {

// "line:column: message" of each problem.
std::vector<std::string> ProblemsOf(const std::string& text) {
  std::vector<YamlProblem> problems;
  const auto root = ParseYaml(text, problems);
  std::vector<std::string> lines;
  for (const auto& p : problems) {
    lines.push_back(std::to_string(p.mark.line) + ":" + std::to_string(p.mark.column) + ": " + p.message);
  }
  EXPECT_TRUE(root.has_value() || !lines.empty()) << text;
  return lines;
}

std::string FirstProblemOf(const std::string& text) {
  const auto problems = ProblemsOf(text);
  return problems.empty() ? "none" : problems.front();
}

YamlNode Parse(const std::string& text) {
  std::vector<YamlProblem> problems;
  const auto root = ParseYaml(text, problems);
  EXPECT_TRUE(problems.empty()) << problems.front().message;
  return root.value_or(YamlNode());
}

YamlNode Value(const std::string& scalar) {
  const YamlNode root = Parse("key: " + scalar + "\n");
  const YamlEntry* entry = root.Find("key");
  EXPECT_NE(entry, nullptr);
  return entry == nullptr ? YamlNode() : entry->value;
}

TEST(YamlTree, KeepsPlacesOfKeysAndValues) {
  const YamlNode root = Parse("a: 1\nb:\n  - {c: x, d: [1, 2]}\n  - e: \"two\"\n");
  EXPECT_EQ(root.mark, (YamlMark{1, 1}));
  ASSERT_EQ(root.entries.size(), 2U);
  EXPECT_EQ(root.entries[1].key_mark, (YamlMark{2, 1}));
  const YamlNode& list = root.entries[1].value;
  EXPECT_EQ(list.mark, (YamlMark{3, 3}));
  EXPECT_EQ(list.items[0].mark, (YamlMark{3, 5}));
  EXPECT_EQ(list.items[0].Find("d")->key_mark, (YamlMark{3, 12}));
  EXPECT_EQ(list.items[0].Find("d")->value.items[1].mark, (YamlMark{3, 19}));
  EXPECT_EQ(list.items[1].Find("e")->value.mark, (YamlMark{4, 8}));
  EXPECT_EQ(list.items[1].Find("e")->value.text_begin, (YamlMark{4, 9}));
  EXPECT_EQ(list.items[1].Find("f"), nullptr);
}

TEST(YamlTree, CountsColumnsInCharacters) {
  const YamlNode root = Parse("{é: ü€𝄞, key: 5}");
  EXPECT_EQ(root.Find("key")->key_mark, (YamlMark{1, 10}));
}

TEST(YamlTree, AcceptsByteOrderMarkAndCarriageReturns) {
  const YamlNode root = Parse("\xEF\xBB\xBFkey: 5\r\nother: six\r\n");
  EXPECT_EQ(root.Find("key")->key_mark, (YamlMark{1, 1}));
  EXPECT_EQ(root.Find("other")->value.text, "six");
  EXPECT_EQ(root.Find("other")->value.mark, (YamlMark{2, 8}));
}

TEST(YamlTree, KnowsWhereTheTextOfAScalarStands) {
  EXPECT_EQ(Value("plain").text_begin, (YamlMark{1, 6}));
  EXPECT_EQ(Value("'single'").text_begin, (YamlMark{1, 7}));
  EXPECT_EQ(Value("'it''s'").text_begin, std::nullopt);
  EXPECT_EQ(Value("\"tab\\t\"").text_begin, std::nullopt);
  EXPECT_EQ(Value(">-\n  folded\n  text").text_begin, std::nullopt);
  EXPECT_EQ(Value(">-\n  folded\n  text").text, "folded text");
}

TEST(YamlTree, NumbersAreWrittenAsInJson) {
  for (const std::string good : {"0", "-0", "1", "-12", "0.5", "1e3", "1E-3", "-1.25e+10"}) {
    EXPECT_EQ(Value(good).kind, YamlNode::Kind::kNumber) << good;
    EXPECT_EQ(Value(good).Number(), std::stod(good)) << good;
  }
  EXPECT_EQ(Value("0.1").Number(), 0.1);
  EXPECT_EQ(Value("1e999").Number(), std::nullopt);
  EXPECT_EQ(Value("-7").Integer(), -7);
  EXPECT_EQ(Value("7.0").Integer(), std::nullopt);
  EXPECT_EQ(Value("1e3").Integer(), std::nullopt);
  EXPECT_EQ(Value("9223372036854775808").Integer(), std::nullopt);
  EXPECT_EQ(Value("\"5\"").kind, YamlNode::Kind::kText);
  EXPECT_EQ(Value("\"5\"").Number(), std::nullopt);
}

TEST(YamlTree, SpellingsThatOthersReadAsNumbersAreAmbiguous) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"010", "write the number without leading zeros"},
      {"-010", "write the number without leading zeros"},
      {"00.5", "write the number without leading zeros"},
      {"0x10", "write the number in decimal"},
      {"0o17", "write the number in decimal"},
      {"0b11", "write the number in decimal"},
      {"1_000", "write the number without underscores"},
      {"+5", "write the number without a plus sign"},
      {".5", "write a digit before the decimal point"},
      {"5.", "write a digit after the decimal point, or leave it out"},
      {".inf", "only finite numbers are allowed"},
      {"-.INF", "only finite numbers are allowed"},
      {".nan", "only finite numbers are allowed"},
      {"nan", "only finite numbers are allowed"},
      {"yes", "only true and false are truth values"},
      {"No", "only true and false are truth values"},
      {"ON", "only true and false are truth values"},
      {"off", "only true and false are truth values"},
      {"y", "only true and false are truth values"},
      {"True", "only true and false are truth values"},
      {"FALSE", "only true and false are truth values"}};
  for (const auto& [text, complaint] : cases) {
    EXPECT_EQ(Value(text).kind, YamlNode::Kind::kAmbiguous) << text;
    EXPECT_EQ(Value(text).complaint, complaint) << text;
    EXPECT_EQ(Value("'" + text + "'").kind, YamlNode::Kind::kText) << text;
  }
  EXPECT_EQ(Value("true").kind, YamlNode::Kind::kBool);
  EXPECT_TRUE(Value("true").boolean());
  EXPECT_FALSE(Value("false").boolean());
  for (const std::string word : {"5ms-delay", "1.2.3", "2026-01-02", "e5", "infinite", "offset", "...x"}) {
    EXPECT_EQ(Value(word).kind, YamlNode::Kind::kText) << word;
  }
  for (const std::string nothing : {"", "~", "null"}) {
    EXPECT_EQ(Value(nothing).kind, YamlNode::Kind::kNull) << nothing;
    EXPECT_EQ(Value(nothing).mark, (YamlMark{1, 1})) << nothing;
  }
}

TEST(YamlTree, RefusesWhatAScenarioNeverNeeds) {
  EXPECT_EQ(FirstProblemOf("a: &x 1\n"), "1:4: anchors (&name) are not allowed");
  EXPECT_EQ(ProblemsOf("a: &x 1\nb: *x\n"),
            (std::vector<std::string>{"1:4: anchors (&name) are not allowed",
                                      "2:4: aliases (*name) are not allowed; write the value out"}));
  EXPECT_EQ(FirstProblemOf("a: !!str 1\n"), "1:4: tags (!type) are not allowed");
  EXPECT_EQ(FirstProblemOf("a: ! 1\n"), "1:4: tags (!type) are not allowed");
  EXPECT_EQ(FirstProblemOf("!map {a: 1}\n"), "1:1: tags (!type) are not allowed");
  EXPECT_EQ(FirstProblemOf("a: 1\nb: 2\na: 3\n"), "3:1: duplicate key 'a'; the first is on line 1");
  EXPECT_EQ(FirstProblemOf("{a: 1, \"a\": {b: 3}}"), "1:8: duplicate key 'a'; the first is on line 1");
  EXPECT_EQ(FirstProblemOf("a: 1\n---\nb: 2\n"), "2:1: a second document begins here; a file holds one");
  EXPECT_EQ(FirstProblemOf("? [1, 2]\n: 3\n"), "1:3: a key must be a plain word");
  EXPECT_EQ(FirstProblemOf("{: 3}\n"), "1:2: a key is missing");
  EXPECT_EQ(FirstProblemOf(""), "1:1: the file is empty");
  EXPECT_EQ(FirstProblemOf("# nothing\n"), "1:1: the file is empty");
  EXPECT_EQ(FirstProblemOf(std::string(17, '[') + std::string(17, ']')),
            "1:17: nested deeper than 16 levels");
  EXPECT_EQ(FirstProblemOf(std::string(kYamlBytesMax + 1, ' ')), "1:1: larger than 1024 KiB");
  std::string keys;
  for (std::size_t i = 0; i <= kYamlKeysMax; ++i) keys.append("k").append(std::to_string(i)).append(": 1\n");
  EXPECT_EQ(FirstProblemOf(keys), "1001:1: more than 1000 keys");
}

TEST(YamlTree, BrokenYamlIsLocated) {
  constexpr const char* kTab = "a tab character: YAML is indented by spaces only";
  EXPECT_EQ(FirstProblemOf("a: 1\n\tb: 2\n"), std::string("2:1: ") + kTab);
  EXPECT_EQ(FirstProblemOf("a:\n  b: 1\n  \tc: 2\nd: 1\n"), std::string("3:3: ") + kTab);
  EXPECT_EQ(FirstProblemOf("a: 1\nb: \"open\n").substr(0, 4), "2:4:");
  EXPECT_EQ(FirstProblemOf("a: [1, 2\n").substr(0, 3), "2:1");
  EXPECT_EQ(FirstProblemOf("a: \"open\n"), "1:4: the quote is never closed");
  EXPECT_EQ(FirstProblemOf("a: \"open\\\""), "1:11: not valid YAML: illegal EOF in scalar");
  EXPECT_EQ(FirstProblemOf("a: 'open''"), "1:11: not valid YAML: illegal EOF in scalar");
  EXPECT_EQ(FirstProblemOf("a: 1\n b: 2\n").substr(0, 2), "2:");
  EXPECT_EQ(FirstProblemOf("a: {b: 1}}\n").substr(0, 2), "1:");
}

TEST(YamlTree, OnlyUtf8TextPasses) {
  EXPECT_EQ(FirstProblemOf(std::string("a: b\nc: \0d", 10)), "2:4: byte 0x00 is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("é: \x1B[2J"), "1:4: byte 0x1B is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("a: \xFF"), "1:4: byte 0xFF is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("a: \xC0\x80"), "1:4: byte 0xC0 is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("a: \xE2\x82"), "1:4: byte 0xE2 is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("a: \xE0\x80\x80"), "1:4: byte 0xE0 is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("a: \xED\xA0\x80"), "1:4: byte 0xED is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf("a: \xF4\x90\x80\x80"), "1:4: byte 0xF4 is not UTF-8 text");
  EXPECT_EQ(FirstProblemOf(std::string("\xFF\xFE") + std::string("a\0:\0", 4)),
            "1:1: byte 0xFF is not UTF-8 text");
}

// Deep, long and repetitive inputs end quickly, with a problem or a tree.
TEST(YamlTree, HostileInputsEnd) {
  for (const std::string unit :
       {"[", "{",   "- ", "? ",    "{a: ",  "[[",  "a: {", ": ", "!", "&a ",    "*",      "\"",
        "'", "|\n", "%",  "---\n", "a:\n ", "-\n", ",",    "]",  "#", "a: b\n", "- - a\n"}) {
    std::string text;
    while (text.size() < 20'000) text += unit;
    ProblemsOf(text);
    ProblemsOf("key: " + text);
  }
}

// Random damage to a good file never crashes, and never yields a tree together with silence about an alias or
// anchor.
TEST(YamlTree, DamagedInputsNeverCrash) {
  const std::string good =
      "name: x\ntags: [a, 'b', \"c\"]\nlink: {baud: 921600, ideal: true}\nfaults:\n  - {id: a, type: b, n: "
      "[1, 2, 3]}\n"
      "  - id: c\n    text: >-\n      folded\n      text\n";
  std::mt19937 random(1);
  for (int i = 0; i < 5000; ++i) {
    std::string text = good;
    const unsigned edits = 1 + random() % 4;
    for (unsigned k = 0; k < edits; ++k) {
      static constexpr std::string_view kBytes = "[]{}:,-?&*!|>'\"%@`#\n\t ~0x\\\xFF";
      const std::size_t at = random() % text.size();
      const char byte = kBytes[random() % kBytes.size()];
      switch (random() % 3) {
        case 0:
          text[at] = byte;
          break;
        case 1:
          text.insert(at, 1, byte);
          break;
        default:
          text.erase(at, 1);
          break;
      }
    }
    std::vector<YamlProblem> problems;
    const auto root = ParseYaml(text, problems);
    EXPECT_TRUE(root.has_value() || !problems.empty()) << text;
    for (const auto& problem : problems) {
      EXPECT_GE(problem.mark.line, 1) << text;
      EXPECT_GE(problem.mark.column, 1) << text;
    }
  }
}

}  // namespace
}  // namespace tiltproof::harness
