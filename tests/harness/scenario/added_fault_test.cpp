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
    const Scenario scenario = Read("  - {id: first, type: harness.null}\n");
    return AddFault(scenario, {.text = text, .id = "injected-1", .start_ns = 1'234 * kNsPerMs}, options_);
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

}  // namespace
}  // namespace tiltproof::harness
