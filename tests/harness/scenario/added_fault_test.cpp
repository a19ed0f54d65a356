// AddFault(): a fault that is injected is checked as one of the file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/harness/scenario/fault_file.h"

namespace tiltproof::harness {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class AddedFaultTest : public FaultFile {
 protected:
  Scenario Add(const std::string& text) {
    Scenario scenario = Read("  - {id: first, type: harness.null}\n");
    AddFault(scenario, {.text = text, .id = "injected-1", .start_ns = 1'234 * kNsPerMs}, options_);
    return scenario;
  }
  std::string ErrorOf(const std::string& text) {
    try {
      Add(text);
    } catch (const ScenarioError& error) {
      return error.what();
    }
    return "no error";
  }
};

TEST_F(AddedFaultTest, IsTheLastOfTheScenario) {
  const Scenario scenario =
      Add("{type: frame.drop, target: to_client, duration_s: 2.5, parameters: {probability: 0.5}}");
  ASSERT_EQ(scenario.faults.size(), 2U);
  const faults::FaultSpec& fault = scenario.faults.back();
  EXPECT_EQ(fault.id, "injected-1");
  EXPECT_EQ(fault.type, "frame.drop");
  EXPECT_EQ(fault.start_ns, 1'234 * kNsPerMs);
  EXPECT_EQ(fault.end_ns, 3'734 * kNsPerMs);
  // The scenario that is left behind can be flown again: it reads back as the same.
  const Scenario again = ParseScenario(WriteResolved(scenario), folder_ / "again.yaml", options_);
  EXPECT_EQ(WriteResolved(again), WriteResolved(scenario));
}

TEST_F(AddedFaultTest, KeepsItsOwnIdAndLastsToTheEnd) {
  const Scenario scenario = Add("id: mine\ntype: link.silence\ntarget: to_client\n");
  EXPECT_EQ(scenario.faults.back().id, "mine");
  EXPECT_EQ(scenario.faults.back().end_ns, kNever);
}

TEST_F(AddedFaultTest, SaysWhatIsWrongAndWhere) {
  EXPECT_THAT(ErrorOf("{type: frame.dorp, target: to_client}"), HasSubstr("fault:1:8: "));
  EXPECT_THAT(ErrorOf("{type: frame.dorp, target: to_client}"), HasSubstr("frame.drop"));
  EXPECT_THAT(ErrorOf("{id: first, type: link.silence, target: to_client}"), HasSubstr("first"));
  EXPECT_THAT(ErrorOf("{type: link.silence, target: to_client, start_s: 3}"),
              HasSubstr("fault:1:41: start_s: a fault that is injected begins now"));
  EXPECT_THAT(ErrorOf("{type: link.silence, target: to_client, duration_s: long}"), HasSubstr("duration_s"));
  EXPECT_THAT(ErrorOf("{type: link.silence, target: to_client, duration_s: -1}"), HasSubstr("duration_s"));
  EXPECT_THAT(ErrorOf("{type: link.silence, nonsense: 1, target: to_client}"), HasSubstr("nonsense"));
  // Named as it was given: the end is none of the user's keys.
  EXPECT_THAT(ErrorOf("{type: device.reset, duration_s: 2}"),
              AllOf(HasSubstr("fault:1:22: duration_s: a fault of this type has a begin only"),
                    Not(HasSubstr("end_s"))));
  EXPECT_THAT(ErrorOf("{type: device.reset, end_s: 2}"),
              HasSubstr("fault:1:22: end_s: a fault that is injected"));
  EXPECT_THAT(ErrorOf("[1, 2]"), HasSubstr("expected a fault"));
  EXPECT_THAT(ErrorOf("{type: ["), HasSubstr("fault:1:"));
}

TEST_F(AddedFaultTest, AnErrorLeavesTheScenarioAsItWas) {
  Scenario scenario = Read("  - {id: first, type: harness.null}\n");
  const std::string before = WriteResolved(scenario);
  const std::filesystem::path file = scenario.file;
  for (const char* text : {"{id: first, type: link.silence, target: to_client}", "{type: frame.dorp}",
                           "{type: link.silence, target: to_client, duration_s: -1}"})
    EXPECT_THROW(AddFault(scenario, {.text = text, .id = "mine"}, options_), ScenarioError) << text;
  EXPECT_EQ(WriteResolved(scenario), before);
  EXPECT_EQ(scenario.file, file);
  EXPECT_EQ(scenario.fault_places.size(), 1U);
}

// 2^17 times a reply of 68 bytes is more than a line holds, 2^16 times is not. A fault between them that doubles nothing
// changes nothing of that.
TEST_F(AddedFaultTest, IsCheckedTogetherWithTheOthers) {
  Scenario scenario = Read("  - {id: first, type: harness.null}\n");
  const auto add = [&](const std::string& id, const std::string& of) {
    AddFault(scenario, {.text = "{target: to_client, " + of + "}", .id = id}, options_);
  };
  const std::string doubles = "type: wire.byte_duplicate, parameters: {probability: 1}";
  for (int i = 0; i < 16; ++i) add("double-" + std::to_string(i), doubles);
  add("flips", "type: wire.bit_error, parameters: {ber: 1e-6}");
  try {
    add("last", doubles);
    FAIL() << "17 duplications were accepted";
  } catch (const ScenarioError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("id: together 'double-0'"), HasSubstr("'last' make more than")));
  }
  EXPECT_EQ(scenario.faults.size(), 18U);
}

}  // namespace
}  // namespace tiltproof::harness
