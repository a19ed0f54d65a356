// What the server puts in force, boundary by boundary.
#include "harness/run/plant_server.h"

#include <gtest/gtest.h>

#include "tests/harness/run/by_hand.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

// A fault that counts commands counts one from the boundary at which it comes into force, and the vehicle's limits hold for
// what it makes of it.
TEST(PlantServer, EverySecondCommandIsOffsetToTheLimitFromItsOwnBoundaryOn) {
  Scenario scenario;
  scenario.duration_ns = kNsPerS;
  scenario.initial_position_m = {0, 0, 5};
  faults::FaultSpec& fault = scenario.faults.emplace_back();
  fault.id = "offset";
  fault.type = "actuator.offset";
  fault.every_nth_count = 2;
  fault.parameters = {{"actuator", "f_r"}, {"value", 1e6}};
  LocalPlantServer server(scenario, Model());
  const link::Protocol& protocol = *scenario.link.protocol;
  const auto receive = [&](TimeNs at, link::MessageKind kind, std::vector<float> values) {
    server.Receive(0, BootTime(at), {protocol.Find(kind), std::move(values)}, [](auto) {});
  };
  receive(0, link::MessageKind::kStart, {});
  for (int command = 1; command <= 6; ++command) {
    const TimeNs at = (command - 1) * kControlPeriodNs;  // on a boundary, as on a line that takes no time
    server.Advance(BootTime(at), AllCounts(1));
    receive(at, link::MessageKind::kActuators, {10, 11, 0, 0});
    for (const TimeNs later : {TimeNs{1}, scenario.step_ns + 1, 2 * scenario.step_ns + 1}) {
      server.Advance(BootTime(at + later), AllCounts(1));
      EXPECT_EQ(server.in_force()[0], command % 2 == 0 ? Model().InputMax()[0] : 10.0)
          << command << ", " << later;
      EXPECT_EQ(server.in_force()[1], 11.0);
    }
  }
}

}  // namespace
}  // namespace tiltproof::harness
