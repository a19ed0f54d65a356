#include "harness/report/json_fields.h"

#include <gtest/gtest.h>

#include <limits>

#include "harness/run/run_log.h"

namespace tiltproof::harness {
namespace {

enum class Color : std::uint8_t { kRed, kGreen };
std::string_view Name(Color color) { return color == Color::kRed ? "red" : "green"; }
constexpr Color LastOf(Color) { return Color::kGreen; }

struct Inner {
  static constexpr bool kLeavesOutNull = true;
  double value = 0.0;
  std::optional<std::string> note;
  TILTPROOF_FIELDS(value, note)
};

struct Outer {
  static constexpr std::array<std::string_view, 1> kNotInFiles = {"secret"};
  std::string name;
  Color color = Color::kRed;
  std::optional<double> margin;
  std::vector<Inner> list;
  std::map<std::string, std::int64_t> counts;
  int secret = 0;
  TILTPROOF_FIELDS(name, color, margin, list, counts, secret)
};
struct ListedPair {
  double x = 0.0;
  std::optional<bool> known;
  static constexpr bool kIsList = true;
  TILTPROOF_FIELDS(x, known)
};

struct Address {
  std::optional<std::string> street, town;
  std::vector<ListedPair> points;
  static constexpr std::array<std::string_view, 1> kLeavesOutNull = {"street"};
  TILTPROOF_FIELDS(street, town, points)
};
static_assert(NamesEveryField<Outer>() && NamesEveryField<Inner>());

std::string ReadErrorOf(const char* text) {
  try {
    FromJson<Outer>(Json::parse(text));
  } catch (const std::exception& error) {
    return error.what();
  }
  return "none";
}

TEST(JsonFields, AStructIsAnObjectOfItsFields) {
  const Outer outer{"a", Color::kGreen, std::nullopt, {{1.5, "x"}, {2.0, std::nullopt}}, {{"n", 3}}, 9};
  EXPECT_EQ(
      ToJson(outer).dump(),
      R"({"name":"a","color":"green","margin":null,"list":[{"value":1.5,"note":"x"},{"value":2.0}],"counts":{"n":3}})");
}

TEST(JsonFields, WhatIsWrittenIsRead) {
  const Outer outer{"a", Color::kGreen, 0.25, {{1.5, "x"}, {2.0, std::nullopt}}, {{"n", 3}}, 0};
  const auto read = FromJson<Outer>(Json::parse(ToJson(outer).dump()));
  EXPECT_EQ(ToJson(read), ToJson(outer));
  EXPECT_EQ(read.list.at(0).note, "x");
  EXPECT_EQ(read.margin, 0.25);
}

TEST(JsonFields, AStructMayBeTheListOfItsValues) {
  const Address address{"a", "b", {{1.5, true}, {2.5, std::nullopt}}};
  EXPECT_EQ(ToJson(address).dump(), R"({"street":"a","town":"b","points":[[1.5,true],[2.5,null]]})");
  const auto read = FromJson<Address>(ToJson(address));
  EXPECT_EQ(ToJson(read), ToJson(address));
  EXPECT_THROW(FromJson<ListedPair>(Json::parse("[1.5]")), std::exception);
  EXPECT_THROW(FromJson<ListedPair>(Json::parse(R"(["x", true])")), std::exception);
}

TEST(JsonFields, ANullMayBeLeftOutOfSomeKeys) {
  EXPECT_EQ(ToJson(Address()).dump(), R"({"town":null,"points":[]})");
}

// JSON has neither.
TEST(JsonFields, InfinityAndNanAreNull) {
  Outer outer;
  outer.margin = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(ToJson(outer)["margin"].is_null());
  outer.margin = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(ToJson(outer)["margin"].is_null());
}

TEST(JsonFields, OnlyOptionalsListsAndMapsMayBeMissing) {
  EXPECT_EQ(ReadErrorOf(R"({"name": "a", "color": "red"})"), "none");
  EXPECT_NE(ReadErrorOf(R"({"color": "red"})").find("name: "), std::string::npos);
}

TEST(JsonFields, AnErrorSaysWhere) {
  EXPECT_EQ(ReadErrorOf(R"({"name": "a", "color": "blue"})"), "color: unknown name 'blue'");
  EXPECT_EQ(
      ReadErrorOf(R"({"name": "a", "color": "red", "list": [{"value": "x"}]})").rfind("list: value: ", 0),
      0u);
}

TEST(JsonFields, AWholeNumberIsOneThatItsTypeHolds) {
  const auto error_with = [](const std::string& count) {
    return ReadErrorOf((R"({"name": "a", "color": "red", "counts": {"n": )" + count + "}}").c_str());
  };
  for (const char* count : {"0", "-9223372036854775808", "9223372036854775807"})
    EXPECT_EQ(error_with(count), "none") << count;
  for (const char* count : {"8.16e38", "-1e19", "9223372036854775808", "1.5"})
    EXPECT_NE(
        error_with(count).find("is not a whole number from -9223372036854775808 to 9223372036854775807"),
        std::string::npos)
        << error_with(count);
  EXPECT_NE(error_with("\"3\"").find("a whole number is needed"), std::string::npos);
  EXPECT_EQ(FromJson<std::uint8_t>(Json(255)), 255);
  EXPECT_THROW(FromJson<std::uint8_t>(Json(256)), std::runtime_error);
  EXPECT_THROW(FromJson<std::uint8_t>(Json(-1)), std::runtime_error);
}

TEST(JsonFields, ATimeIsOneThatNanosecondsHold) {
  EXPECT_EQ(TimeFromFile(1.5), 1'500'000'000);
  for (const double time_s : {9e9, -9e9, 1e300, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(TimeFromFile(time_s), std::runtime_error) << time_s;
}

TEST(JsonFields, AnArrayByDirectionHasTheirNames) {
  LineCounts counts{};
  counts[1].frames_sent = 7;
  const Json json = ToJson(counts);
  EXPECT_EQ(json.at("to_client").at("frames_sent"), 7);
  EXPECT_EQ(FromJson<LineCounts>(json)[1].frames_sent, 7);
}

}  // namespace
}  // namespace tiltproof::harness
