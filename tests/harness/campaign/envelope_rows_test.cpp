#include "harness/campaign/envelope_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/campaign/fault_level.h"
#include "tests/harness/campaign/tilt_rotor.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::string> Places(const std::string& type) {
  std::vector<std::string> places;
  for (const EnvelopeRow& row : EnvelopeRows(*faults::FindFaultType(type), TiltRotorSignals()))
    places.push_back(row.place_key + " " + row.place + (row.side.empty() ? "" : " " + row.side));
  return places;
}

Scenario WithPlaceholder() {
  Scenario base;
  base.duration_ns = 40 * kNsPerS;
  faults::FaultSpec other, probe;
  other.id = "other";
  other.type = "frame.drop";
  probe.id = "probe";
  probe.type = "harness.null";
  probe.start_ns = 10 * kNsPerS;
  probe.end_ns = 15 * kNsPerS;
  base.faults = {other, probe};
  return base;
}

TEST(EnvelopeRows, AreTheTypesPlaces) {
  EXPECT_THAT(Places("frame.drop"),
              ElementsAre("target to_plant", "target to_client", "target both", "target reference"));
  EXPECT_THAT(Places("uart.overrun"), ElementsAre("target to_client", "target reference"));
  EXPECT_THAT(Places("sensor.bias"),
              ElementsAre("signal x_m positive", "signal x_m negative", "signal z_m positive",
                          "signal z_m negative", "signal roll_rad positive", "signal roll_rad negative",
                          "signal wx_rad_s positive", "signal wx_rad_s negative"));
  EXPECT_THAT(Places("sensor.freeze"),
              ElementsAre("signal x_m", "signal z_m", "signal roll_rad", "signal wx_rad_s"));
  EXPECT_THAT(Places("sensor.spoof"), ElementsAre("signal x_m positive", "signal x_m negative",
                                                  "signal z_m positive", "signal z_m negative"));
  EXPECT_THAT(Places("sensor.misalignment"),
              ElementsAre("signal position positive", "signal position negative", "signal velocity positive",
                          "signal velocity negative", "signal rates positive", "signal rates negative"));
  EXPECT_THAT(Places("actuator.lag"), ElementsAre("actuator f_r", "actuator tau_r"));
  EXPECT_THAT(Places("plant.force"), ElementsAre(" "));
  EXPECT_THAT(Places("device.reset"), ElementsAre(" "));
}

TEST(EnvelopeRows, TheFaultIsOnTheClientOfItsPlaceholder) {
  Scenario base = WithPlaceholder();
  base.faults[1].client = "a";
  const auto client = [&](const std::string& type) {
    const EnvelopeRow row = EnvelopeRows(*faults::FindFaultType(type), TiltRotorSignals()).front();
    return WithRow(base, row, TiltRotorSignals()).faults[1].client;
  };
  EXPECT_EQ(client("sensor.bias"), "a");
  EXPECT_EQ(client("actuator.lag"), "") << "on the vehicle";
}

TEST(EnvelopeRows, EachRowOfEachTypeIsAValidFault) {
  for (const faults::FaultType& type : faults::FaultTypes()) {
    for (const EnvelopeRow& row : EnvelopeRows(type, TiltRotorSignals())) {
      const Scenario scenario = WithRow(WithPlaceholder(), row, TiltRotorSignals());
      ASSERT_EQ(scenario.faults.size(), 2u);
      EXPECT_EQ(scenario.faults[0].type, "frame.drop") << "others stay";
      EXPECT_EQ(scenario.faults[1].type, type.name);
      EXPECT_EQ(scenario.faults[1].id, "probe");
      for (const faults::Problem& problem : faults::Validate(scenario.faults[1]))
        ADD_FAILURE() << type.name << " " << row.place << ": " << problem.key << ": " << problem.message;
    }
  }
}

// A search begins at the harmless value and goes to the side on which the row's own value is.
TEST(EnvelopeRows, EachSideIsSearchedOnItsOwn) {
  int count = 0;
  for (const faults::FaultType& type : faults::FaultTypes()) {
    for (const EnvelopeRow& row : EnvelopeRows(type, TiltRotorSignals())) {
      if (row.side.empty()) continue;
      const Severity severity =
          SeverityOf(WithRow(WithPlaceholder(), row, TiltRotorSignals()), 1, TiltRotorSignals());
      const double harmless = severity.range.harmless.value();
      EXPECT_EQ(severity.range.start, harmless) << type.name;
      EXPECT_EQ(severity.range.end > harmless, row.side == "positive") << type.name << " " << row.side;
      ++count;
    }
  }
  EXPECT_GT(count, 10);
}

TEST(EnvelopeRows, ASignalIsNotSwappedWithItself) {
  for (const EnvelopeRow& row : EnvelopeRows(*faults::FindFaultType("sensor.swap"), TiltRotorSignals())) {
    const auto parameters = WithRow(WithPlaceholder(), row, TiltRotorSignals()).faults[1].parameters;
    EXPECT_NE(parameters.at("signal"), parameters.at("with"));
  }
}

TEST(EnvelopeRows, TwoFaultsHaveIdsOfTheirOwn) {
  const auto first = EnvelopeRows(*faults::FindFaultType("frame.drop"), TiltRotorSignals());
  const auto second = EnvelopeRows(*faults::FindFaultType("plant.force"), TiltRotorSignals());
  const Scenario scenario = WithSecondRow(WithPlaceholder(), first[0], second[0], TiltRotorSignals());
  ASSERT_EQ(scenario.faults.size(), 3u);
  EXPECT_EQ(scenario.faults[2].type, "plant.force");
  EXPECT_EQ(scenario.faults[2].id, "probe-second");
  EXPECT_EQ(scenario.faults[2].start_ns, 10 * kNsPerS);
}

TEST(EnvelopeRows, ABaseSaysWhereFaultsAct) {
  EXPECT_EQ(FindPlaceholder(WithPlaceholder()), 1u);
  EXPECT_EQ(FindPlaceholder(Scenario()), std::nullopt);
}

}  // namespace
}  // namespace tiltproof::harness
