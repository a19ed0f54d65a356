// Conditions that faults wait for, periods, and compounds in a scenario's file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/formula/condition.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/reader.h"
#include "tests/harness/scenario/fault_file.h"

namespace tiltproof::harness {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

const std::vector<std::string> kSignals = {"z_m", "speed_m_s"};

class TriggerKeysTest : public FaultFile {
 protected:
  TriggerKeysTest() {
    options_.check_condition = [](std::string_view text, const Scenario&) -> std::optional<FormulaProblem> {
      try {
        const stl::Condition condition(text, kSignals);
        return std::nullopt;
      } catch (const stl::ParseError& error) {
        return FormulaProblem{error.column, error.what()};
      }
    };
  }
};

TEST_F(TriggerKeysTest, AreReadAndWrittenBack) {
  const Scenario scenario = Read(
      "- {id: a, type: link.silence, start_s: 1, end_s: 9, period_s: 0.5, duty: 0.25}\n"
      "- {id: b, type: link.silence, when: \"z_m > 1 and not (speed_m_s < 2)\", edge: rising}\n"
      "- {id: c, type: link.silence, after: {fault: b, delay_s: 1.5}}\n"
      "- {id: d, type: link.silence, after: {fault: c}, when: \"z_m > 1\"}\n");
  const auto& all = scenario.faults;
  EXPECT_EQ(all.at(0).period_ns, kNsPerS / 2);
  EXPECT_EQ(all[0].duty, 0.25);
  EXPECT_EQ(all[1].when, "z_m > 1 and not (speed_m_s < 2)");
  EXPECT_EQ(all[1].edge, faults::Edge::kRising);
  EXPECT_EQ(all[2].after, (faults::After{"b", 3 * kNsPerS / 2}));
  EXPECT_EQ(all[3].after, (faults::After{"c", 0}));
  EXPECT_EQ(all[3].edge, faults::Edge::kLevel);
  EXPECT_EQ(all[0].after, std::nullopt);
}

TEST_F(TriggerKeysTest, MistakesHaveTheirPlaces) {
  // One mistake is one error.
  EXPECT_EQ(Error("- {id: a, type: wire.bit_error, target: both, ber: 0}\n"),
            "s.yaml:5:47: 'ber' belongs into 'parameters': parameters: {ber: ...}");
  EXPECT_EQ(
      Error("- {id: a, type: link.silence, when: \"z_m > 1 and zz_m > 2\"}\n"),
      "s.yaml:5:50: when: unknown signal 'zz_m'; did you mean 'z_m'? all signals: tiltproof list --signals");
  EXPECT_THAT(Error("- {id: a, type: link.silence, when: \"always(z_m > 1)\"}\n"),
              StartsWith("s.yaml:5:38: when: 'always' looks at more than one row"));
  EXPECT_THAT(Error("- {id: a, type: link.silence, edge: rising}\n"),
              StartsWith("s.yaml:5:37: edge: needs when"));
  EXPECT_THAT(Error("- {id: a, type: link.silence, period_s: 1, duty: 0.5}\n"),
              StartsWith("s.yaml:5:41: period_s: needs start_s"));
  EXPECT_THAT(Error("- {id: a, type: link.silence, start_s: 1, period_s: 1}\n"),
              StartsWith("s.yaml:5:53: period_s: needs duty"));
  EXPECT_THAT(
      Error("- {id: a, type: device.reset, start_s: 1, when: \"z_m > 1\", parameters: {boot_ms: 5}}\n"),
      HasSubstr("when: a fault of this type is a command, planned before the flight"));
}

TEST_F(TriggerKeysTest, WhatIsWaitedForMustBeThereAndNotWaitBack) {
  EXPECT_EQ(
      Error("- {id: storm, type: link.silence}\n- {id: b, type: link.silence, after: {fault: strom}}\n"),
      "s.yaml:6:46: after: there is no fault 'strom'; did you mean 'storm'?");
  EXPECT_THAT(Error("- {id: a, type: link.silence, after: {fault: a}}\n"),
              StartsWith("s.yaml:5:46: after.fault: a fault cannot wait for itself"));
  const std::string circle = Error(
      "- {id: a, type: link.silence, after: {fault: b}}\n"
      "- {id: b, type: link.silence, after: {fault: c}}\n"
      "- {id: c, type: link.silence, after: {fault: a}}\n");
  EXPECT_THAT(circle,
              StartsWith("s.yaml:5:46: after: 'a' waits for 'b', which waits for 'c', which waits for 'a'"));
  // One that waits for a circle is not in it.
  EXPECT_THAT(Error("- {id: a, type: link.silence, after: {fault: b}}\n"
                    "- {id: b, type: link.silence, after: {fault: c}}\n"
                    "- {id: c, type: link.silence, after: {fault: b}}\n"),
              Not(HasSubstr("s.yaml:5:")));
}

TEST_F(TriggerKeysTest, ACompoundGivesItsMembersAWindow) {
  const Scenario scenario = Read(
      "- {id: first, type: link.silence, start_s: 1, end_s: 2}\n"
      "- id: storm\n"
      "  compound:\n"
      "    - {id: a, type: link.silence}\n"
      "    - {id: b, type: link.silence, start_s: 4}\n"
      "    - {id: c, type: link.silence, end_s: 6}\n"
      "    - {id: d, type: device.reset, parameters: {boot_ms: 5}}\n"
      "  start_s: 3\n"
      "  end_s: 5\n"
      "- {id: last, type: link.silence}\n");
  std::vector<std::string> ids;
  std::vector<std::pair<TimeNs, TimeNs>> windows;
  for (const auto& fault : scenario.faults) {
    ids.push_back(fault.id);
    windows.emplace_back(fault.start_ns, fault.end_ns);
  }
  EXPECT_THAT(ids, ElementsAre("first", "a", "b", "c", "d", "last"));
  constexpr TimeNs kS = kNsPerS;
  EXPECT_THAT(windows,
              ElementsAre(std::pair(kS, 2 * kS), std::pair(3 * kS, 5 * kS), std::pair(4 * kS, 5 * kS),
                          std::pair(3 * kS, 6 * kS), std::pair(3 * kS, kNever), std::pair(kPowerOn, kNever)));
  EXPECT_THAT(scenario.fault_places.at(2), testing::EndsWith("s.yaml:9:21"));
}

// Whatever its kind, a member has the compound's window, as far as its type has one; its periods are its own.
TEST_F(TriggerKeysTest, ACompoundGivesItsWindowToEveryType) {
  for (const faults::FaultType& type : faults::FaultTypes()) {
    if (type.name == "frame.length_error") continue;  // the frames of `paper` have no length
    std::string example = faults::Markdown(type);
    example = example.substr(example.find("- {id: example"));
    example = example.substr(0, example.find('\n'));
    for (const std::string key : {", start_s: 20", ", end_s: 25"})
      if (const auto at = example.find(key); at != std::string::npos) example.erase(at, key.size());
    const Scenario scenario =
        Read("- id: storm\n  start_s: 3\n  end_s: 5\n  compound:\n    " + example + "\n");
    ASSERT_EQ(scenario.faults.size(), 1U) << type.name;
    const faults::FaultSpec& member = scenario.faults.front();
    EXPECT_EQ(member.id, "example");
    EXPECT_EQ(member.start_ns, type.start == faults::Bound::kRefused ? kPowerOn : 3 * kNsPerS) << type.name;
    EXPECT_EQ(member.end_ns, type.end == faults::Bound::kRefused ? kNever : 5 * kNsPerS) << type.name;
  }
}

TEST_F(TriggerKeysTest, MistakesInCompoundsHaveTheirPlaces) {
  EXPECT_EQ(Error("- {id: storm, compound: [{id: a, type: link.silence}], strat_s: 1}\n"),
            "s.yaml:5:56: unknown key 'strat_s'; did you mean 'start_s'?");
  EXPECT_EQ(Error("- {id: storm, compound: []}\n"),
            "s.yaml:5:25: compound: expected a list of faults, found an empty one");
  EXPECT_THAT(Error("- {id: storm, compound: 3}\n"),
              HasSubstr("s.yaml:5:25: compound: expected a list of faults"));
  EXPECT_THAT(Error("- {compound: [{id: a, type: link.silence}]}\n"), HasSubstr("missing key 'id'"));
  EXPECT_THAT(Error("- {id: storm, compound: [{id: inner, compound: [{id: a, type: link.silence}]}]}\n"),
              StartsWith("s.yaml:5:38: compound: a compound has no compound inside"));
  EXPECT_THAT(Error("- {id: storm, compound: [{id: a, type: link.silnce}]}\n"),
              AllOf(StartsWith("s.yaml:5:40:"), HasSubstr("did you mean 'link.silence'?")));
  EXPECT_EQ(Error("- {id: storm, compound: [{id: storm, type: link.silence}]}\n"),
            "s.yaml:5:31: id: 'storm' is taken already on line 5");
  EXPECT_THAT(Error("- {id: storm, start_s: 5, compound: [{id: a, type: link.silence, end_s: 4}]}\n"),
              HasSubstr("the window must end after it begins"));
}

// In real time only the plant's node knows of conditions and activations in time.
TEST_F(TriggerKeysTest, InRealTimeFaultsOfThePlantAloneWait) {
  const auto problems = [&](const std::string& faults, bool realtime) {
    ClientAbilities abilities;
    abilities.realtime = realtime;
    std::vector<std::string> texts;
    for (const Problem& problem : UnsupportedFaults(Read(faults), {abilities})) texts.push_back(problem.text);
    return texts;
  };
  const std::string bias = "type: sensor.bias, parameters: {signal: x_m, offset: 1}";
  const std::string waits =
      "- {id: a, " + bias + ", when: \"z_m > 1\"}\n- {id: b, " + bias + ", after: {fault: a}}\n";
  EXPECT_THAT(problems(waits, true), IsEmpty());
  const std::string silence = "- {id: a, type: link.silence, when: \"z_m > 1\"}\n";
  EXPECT_THAT(problems(silence, false), IsEmpty());
  EXPECT_THAT(problems(silence, true), ElementsAre(HasSubstr("others need --mode lockstep")));
  const std::string follows = "- {id: a, type: link.silence}\n- {id: b, " + bias + ", after: {fault: a}}\n";
  EXPECT_THAT(problems(follows, false), IsEmpty());
  EXPECT_THAT(problems(follows, true), ElementsAre(HasSubstr("waits for fault 'a'")));
}

}  // namespace
}  // namespace tiltproof::harness
