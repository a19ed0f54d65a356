// Inputs that the server puts in force, boundary by boundary.
#include "harness/run/plant_server.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/harness/run/by_hand.h"
#include "tests/harness/run/kept_records.h"
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
  KeptRecords records;
  LocalPlantServer server(scenario, Model(), records);
  const link::Protocol& protocol = *scenario.link.protocol;
  const auto receive = [&](TimeNs at, link::MessageKind kind, std::vector<double> values) {
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

// Command, fault, limit, lag: the row has the thrust after the lag, and beside it the command.
TEST(PlantServer, RowsShowTheThrustAfterTheRotorsLag) {
  plant::VehicleModel model = Model();
  for (plant::Rotor& rotor : model.rotors) rotor.time_constant_up_s = rotor.time_constant_down_s = 0.1;
  Scenario scenario;
  scenario.duration_ns = 10 * kControlPeriodNs;
  scenario.initial_position_m = {0, 0, 5};
  faults::FaultSpec& fault = scenario.faults.emplace_back();
  fault.id = "offset";
  fault.type = "actuator.offset";
  fault.parameters = {{"actuator", "f_l"}, {"value", 1e6}};
  KeptRecords records;
  LocalPlantServer server(scenario, model, records);
  const link::Protocol& protocol = *scenario.link.protocol;
  const auto receive = [&](link::MessageKind kind, std::vector<double> values) {
    server.Receive(0, BootTime(0), {protocol.Find(kind), std::move(values)}, [](auto) {});
  };
  receive(link::MessageKind::kStart, {});
  receive(link::MessageKind::kActuators, {20, 8, 0, 0});
  server.Advance(BootTime(scenario.duration_ns), AllCounts(1));
  const std::vector<record::Row> rows = records.Of<record::Row>();
  ASSERT_GE(rows.size(), 9U);
  const TraceLayout layout(model.signals(), scenario);
  for (std::size_t k = 0; k < 9; ++k) {
    // The step that starts at the row's time is the one that is in force: three steps of 4 ms in each period.
    const double left_of_way = std::exp(-0.004 * static_cast<double>(3 * k + 1) / 0.1);
    const std::vector<double>& row = rows[k].values;
    EXPECT_NEAR(row[layout.inputs], 20 + (model.HoverInput()[0] - 20) * left_of_way, 1e-9) << k;
    EXPECT_NEAR(row[layout.inputs + 1], 30 + (model.HoverInput()[1] - 30) * left_of_way, 1e-9) << k;
    EXPECT_EQ(row[layout.commanded], 20) << k;
    EXPECT_EQ(row[layout.commanded + 1], 8) << k;
  }
}

// Commands, a fault on the vehicle and a place below the ground would each end a flight that is not held.
TEST(PlantServer, AVehicleThatIsHeldStaysWhereItIsWhateverHappens) {
  Scenario scenario;
  scenario.duration_ns = kNsPerS;
  scenario.held = true;
  scenario.initial_position_m = {1, 2, -5};
  scenario.initial_attitude_rad = {0.1, -0.2, 0.3};
  faults::FaultSpec& fault = scenario.faults.emplace_back();
  fault.id = "force";
  fault.type = "plant.force";
  fault.parameters = {{"force_n", 500.0}, {"direction", std::array{1.0, 0.0, 0.0}}};
  KeptRecords records;
  LocalPlantServer server(scenario, Model(), records);
  const link::Protocol& protocol = *scenario.link.protocol;
  const auto receive = [&](link::MessageKind kind, std::vector<double> values) {
    server.Receive(0, BootTime(0), {protocol.Find(kind), std::move(values)}, [](auto) {});
  };
  receive(link::MessageKind::kStart, {});
  receive(link::MessageKind::kActuators, {30, 0, 2, -2});
  const std::vector<double> truth = server.Truth();
  server.Advance(BootTime(kNsPerS), AllCounts(1));
  EXPECT_FALSE(server.state().over);
  EXPECT_EQ(server.state().reached_ns, kNsPerS);
  EXPECT_EQ(server.Truth(), truth);
  EXPECT_EQ(server.in_force()[0], Model().InputMax()[0]);
  server.Finish(BootTime(kNsPerS), AllCounts(1));
  const std::vector<record::Row> rows = records.Of<record::Row>();
  EXPECT_EQ(rows.size(), static_cast<std::size_t>(kNsPerS / kControlPeriodNs) + 2);
  for (const record::Row& row : rows)
    for (std::size_t state = 0; state < truth.size(); ++state)
      ASSERT_EQ(row.values[1 + state], truth[state]) << row.values[0];
}

// The tilt-rotor with an IMU that has noise, and a receiver 100 ms late.
plant::VehicleModel ModelWithSensors() {
  plant::VehicleModel model = Model();
  model.sensors = {{.kind = plant::SensorKind::kImu, .name = "imu0"},
                   {.kind = plant::SensorKind::kGnss, .name = "gnss0", .latency_s = 0.1}};
  for (plant::Sensor& sensor : model.sensors) sensor.noise.resize(plant::SignalCount(sensor.kind));
  for (plant::SensorNoise& noise : model.sensors[0].noise) noise.stddev = 0.01;
  return model;
}

// The rows of a second, in which the client asks for sensors every control period.
std::vector<record::Row> RowsWithSensors(Scenario scenario, TraceLayout& layout) {
  scenario.duration_ns = kNsPerS;
  scenario.initial_position_m = {0, 0, 5};
  const plant::VehicleModel model = ModelWithSensors();
  layout = TraceLayout(model.signals(), scenario);
  KeptRecords records;
  LocalPlantServer server(scenario, model, records);
  const link::Protocol& protocol = *scenario.link.protocol;
  const auto receive = [&](TimeNs at, link::MessageKind kind) {
    server.Receive(0, BootTime(at), {protocol.Find(kind), {}}, [](auto) {});
  };
  receive(0, link::MessageKind::kStart);
  for (TimeNs at = 0; at < kNsPerS; at += kControlPeriodNs) {
    server.Advance(BootTime(at), AllCounts(1));
    receive(at, link::MessageKind::kRequest);
  }
  server.Finish(BootTime(kNsPerS), AllCounts(1));
  return records.Of<record::Row>();
}

TEST(PlantServer, SensorsOfTheFileAreColumnsBeforeAndAfterTheirFaults) {
  Scenario scenario;
  faults::FaultSpec& fault = scenario.faults.emplace_back();
  fault.id = "offset";
  fault.type = "sensor.bias";
  fault.parameters = {{"signal", "acc"}, {"offset", 5.0}};
  TraceLayout layout(Model().signals(), scenario);
  const std::vector<record::Row> rows = RowsWithSensors(scenario, layout);
  const auto column = [&](const std::string& name) { return layout.columns.Find(name).value(); };
  // The order of the columns.
  EXPECT_EQ(column("acc_x_m_s2"), column("yaw_ref_rad") + 1);
  EXPECT_EQ(column("sensed_x_m"), column("gnss_vd_m_s") + 1);
  EXPECT_EQ(column("commanded_f_r_n"), column("sensed_gnss_vd_m_s") + 1);
  const record::Row& row = rows.at(40);
  const double acc = row.values[column("acc_z_m_s2")];
  EXPECT_NEAR(acc, 9.81, 0.1);
  // The row at the boundary is logged after the request of this period: same sample, with the fault.
  EXPECT_DOUBLE_EQ(row.values[column("sensed_acc_z_m_s2")], acc + 5);
  EXPECT_EQ(row.values[column("sensed_gyro_x_rad_s")], row.values[column("gyro_x_rad_s")]);
  EXPECT_NE(row.values[column("gyro_x_rad_s")], rows.at(39).values[column("gyro_x_rad_s")]);
  // Full precision: 1e-9 deg are 0.1 mm.
  EXPECT_NEAR(row.values[column("sensed_gnss_lat_deg")], 47.397742, 1e-9);
}

TEST(PlantServer, WithoutNoiseNothingOfTheSensorsFollowsFromTheSeed) {
  Scenario scenario;
  scenario.sensor_noise = false;
  TraceLayout layout(Model().signals(), scenario);
  const auto fly = [&](std::uint64_t seed) {
    scenario.seed = seed;
    return RowsWithSensors(scenario, layout);
  };
  const std::vector<record::Row> first = fly(1), other = fly(2);
  ASSERT_EQ(first.size(), other.size());
  for (std::size_t r = 0; r < first.size(); ++r)
    for (std::size_t i = 0; i < layout.sensed; ++i) ASSERT_EQ(first[r].values[i], other[r].values[i]) << i;
  // The vehicle hovers: the noise of 0.01 m/s^2 would be seen.
  const std::size_t acc_x = layout.columns.Find("acc_x_m_s2").value();
  EXPECT_NEAR(first.at(40).values[acc_x], first.at(41).values[acc_x], 1e-6);
}

TEST(PlantServer, TheSeedDecidesTheNoiseOfSensorsAndNothingElse) {
  Scenario scenario;
  TraceLayout layout(Model().signals(), scenario);
  const auto fly = [&](std::uint64_t seed) {
    scenario.seed = seed;
    return RowsWithSensors(scenario, layout);
  };
  const std::vector<record::Row> first = fly(1), same = fly(1), other = fly(2);
  ASSERT_EQ(first.size(), other.size());
  for (std::size_t r = 0; r < first.size(); ++r) {
    // Before the first request, what was sent is NaN.
    for (std::size_t i = 0; i < layout.sensed; ++i) ASSERT_EQ(first[r].values[i], same[r].values[i]) << i;
    for (std::size_t i = 0; i < layout.measured; ++i) ASSERT_EQ(first[r].values[i], other[r].values[i]) << i;
    EXPECT_NE(first[r].values[layout.measured], other[r].values[layout.measured]);
  }
}

}  // namespace
}  // namespace tiltproof::harness
