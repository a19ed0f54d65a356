#include "harness/node/deaf_receiver.h"

#include <gtest/gtest.h>

#include <string>

namespace tiltproof::harness {
namespace {

faults::FaultSpec Fault(const std::string& type, TimeNs start_ns, TimeNs end_ns) {
  faults::FaultSpec spec;
  spec.id = type + "-" + std::to_string(start_ns);
  spec.type = type;
  spec.start_ns = start_ns;
  spec.end_ns = end_ns;
  return spec;
}

TEST(DeafReceiverTest, HearsEverythingWhileNothingHoldsTheProcessor) {
  DeafReceiver without;
  EXPECT_EQ(without.Keeps(0, 100), 100u);
  Scenario scenario;
  scenario.faults = {Fault("device.stall", kNsPerS, 2 * kNsPerS)};
  DeafReceiver receiver(scenario);
  EXPECT_EQ(receiver.Keeps(-kNsPerMs, 100), 100u);
  EXPECT_EQ(receiver.Keeps(kNsPerS - 1, 100), 100u);
  EXPECT_EQ(receiver.Keeps(2 * kNsPerS, 100), 100u);
}

TEST(DeafReceiverTest, AProcessorThatStandsStillLeavesTheFirstByteInTheReceiver) {
  Scenario scenario;
  scenario.faults = {Fault("device.stall", kNsPerS, 2 * kNsPerS),
                     Fault("device.stall", 3 * kNsPerS, 4 * kNsPerS)};
  DeafReceiver receiver(scenario);
  EXPECT_EQ(receiver.Keeps(kNsPerS, 72), 1u);
  EXPECT_EQ(receiver.Keeps(kNsPerS + kNsPerMs, 72), 0u);
  EXPECT_EQ(receiver.Keeps(2 * kNsPerS + kNsPerMs, 72), 72u);
  EXPECT_EQ(receiver.Keeps(3 * kNsPerS + kNsPerMs, 1), 1u) << "the next time again";
  EXPECT_EQ(receiver.Keeps(4 * kNsPerS - 1, 1), 0u);
}

TEST(DeafReceiverTest, OneInResetLosesEverything) {
  Scenario scenario;
  scenario.faults = {Fault("device.reset", kNsPerS, kNever), Fault("device.stall", 0, 2 * kNsPerS)};
  scenario.faults[0].parameters["boot_ms"] = 20.0;
  DeafReceiver receiver(scenario);
  EXPECT_EQ(receiver.Keeps(kNsPerS + 10 * kNsPerMs, 72), 0u);
  // The stall outlasts the reset, in which its byte was lost.
  EXPECT_EQ(receiver.Keeps(kNsPerS + 30 * kNsPerMs, 72), 0u);
  EXPECT_EQ(receiver.Keeps(2 * kNsPerS, 72), 72u);
}

}  // namespace
}  // namespace tiltproof::harness
