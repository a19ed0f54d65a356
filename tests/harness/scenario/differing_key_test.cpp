#include "harness/scenario/differing_key.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

const std::string kBase = R"(name: "x"
description: "One."
tags: ["a"]
firmware: "paper"
expect: pass
seed: 7
duration_s: 24
link:
  ideal: false
  baud: 921600
reference:
  type: hover
  at_m: [0, 0, 2]
faults:
  - id: "a"
    type: wire.bit_error
    parameters:
      ber: 0.001
  - id: "b"
    type: harness.null
criteria: []
)";

std::string With(const std::string& old, const std::string& now) {
  std::string text = kBase;
  const auto at = text.find(old);
  if (at == std::string::npos) throw std::logic_error("not in the base: " + old);
  return text.replace(at, old.size(), now);
}

TEST(DifferingKeyTest, NoneWhereTheFlightIsTheSame) {
  EXPECT_THAT(DifferingKeys(kBase, kBase), IsEmpty());
  // Keys that describe or judge a flight, or choose its firmware; the last case only changes the order of keys.
  EXPECT_THAT(DifferingKeys(kBase, With("\"x\"", "\"y\"")), IsEmpty());
  EXPECT_THAT(DifferingKeys(kBase, With("\"One.\"", "\"Two.\"")), IsEmpty());
  EXPECT_THAT(DifferingKeys(kBase, With("[\"a\"]", "[]")), IsEmpty());
  EXPECT_THAT(DifferingKeys(kBase, With("\"paper\"", "\"tolerant\"")), IsEmpty());
  EXPECT_THAT(DifferingKeys(kBase, With("expect: pass", "expect: fail")), IsEmpty());
  EXPECT_THAT(DifferingKeys(kBase, With("criteria: []", "criteria:\n  - name: \"a\"")), IsEmpty());
  EXPECT_THAT(DifferingKeys(kBase, With("seed: 7\nduration_s: 24\n", "duration_s: 24\nseed: 7\n")),
              IsEmpty());
}

TEST(DifferingKeyTest, NamesAllOfThemInOrder) {
  EXPECT_THAT(DifferingKeys(kBase, With("seed: 7\nduration_s: 24", "seed: 8\nduration_s: 60")),
              ElementsAre("seed: 7 and 8", "duration_s: 24 and 60"));
}

TEST(DifferingKeyTest, NamesTheKeyAndBothValues) {
  const auto differs = [](const std::string& old, const std::string& now) {
    const auto keys = DifferingKeys(kBase, With(old, now));
    return keys.empty() ? "none" : keys.front();
  };
  EXPECT_EQ(differs("seed: 7", "seed: 8"), "seed: 7 and 8");
  EXPECT_EQ(differs("duration_s: 24", "duration_s: 60"), "duration_s: 24 and 60");
  EXPECT_EQ(differs("baud: 921600", "baud: 115200"), "link.baud: 921600 and 115200");
  EXPECT_EQ(differs("[0, 0, 2]", "[0, 0, 3]"), "reference.at_m: [0, 0, 2] and [0, 0, 3]");
  EXPECT_EQ(differs("ber: 0.001", "ber: 0.01"), "faults[0].parameters.ber: 0.001 and 0.01");
  EXPECT_EQ(differs("id: \"b\"", "id: \"c\""), "faults[1].id: b and c");
  EXPECT_EQ(differs("  - id: \"b\"\n    type: harness.null\n", ""), "faults: 2 and 1 items");
  EXPECT_EQ(differs("seed: 7\n", ""), "seed: 7 and absent");
  EXPECT_EQ(differs("criteria: []", "criteria: []\nmodel: \"m\""), "model: absent and m");
  // The key `name` of a fault is none that may differ; only those of the scenario are.
  EXPECT_EQ(differs("type: harness.null", "type: harness.null\n    firmware: \"z\""),
            "faults[1].firmware: absent and z");
}

TEST(DifferingKeyTest, WhatIsNoScenarioIsAnError) {
  EXPECT_THROW(DifferingKeys(kBase, "- 1\n"), std::runtime_error);
  EXPECT_THROW(DifferingKeys("a: [", kBase), std::runtime_error);
  EXPECT_THROW(DifferingKeys("", kBase), std::runtime_error);
}

}  // namespace
}  // namespace tiltproof::harness
