// Values that a field cannot carry, against those that the receiver gets.
#include "harness/run/message_range.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "harness/reference/trajectory.h"
#include "harness/run/message_binding.h"
#include "tests/harness/run/by_hand.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using link::MessageField;
using link::NumberType;

MessageField Field(const std::string& signal, NumberType type, double scale) {
  return {.signal = signal,
          .min = scale * link::LeastNumber(type),
          .max = scale * link::LargestNumber(type),
          .type = type,
          .scale = scale};
}

// A protocol with a reference of these fields, states of these, and actuator messages of the paper's inputs.
Scenario ScenarioWith(std::vector<MessageField> reference, std::vector<MessageField> states = {},
                      std::vector<MessageField> inputs = {}) {
  link::Protocol protocol;
  protocol.name = "test";
  protocol.control_period_ns = 12 * kNsPerMs;
  protocol.messages = {link::LayOut({.name = "reference",
                                     .kind = link::MessageKind::kReference,
                                     .direction = Direction::kReference,
                                     .fields = std::move(reference)}),
                       link::LayOut({.name = "states",
                                     .kind = link::MessageKind::kReply,
                                     .direction = Direction::kToClient,
                                     .fields = std::move(states)}),
                       link::LayOut({.name = "actuators",
                                     .kind = link::MessageKind::kActuators,
                                     .direction = Direction::kToPlant,
                                     .fields = std::move(inputs)})};
  Scenario scenario;
  scenario.duration_ns = 10 * kNsPerS;
  scenario.link.protocol = std::make_shared<link::Protocol>(protocol);
  scenario.reference.path = HoverReference{};
  return scenario;
}

TEST(MessageRange, AHeadingBeyondItsFieldIsSentAsTheEndOfTheRange) {
  Scenario scenario = ScenarioWith({Field("yaw_rad", NumberType::kI16, 1e-4)});
  scenario.reference.path = HoverReference{.yaw_rad = 4};
  const auto beyond = PathBeyondRange(scenario, Model().signals());
  ASSERT_EQ(beyond.size(), 1U);
  EXPECT_EQ(beyond[0].field->signal, "yaw_rad");
  EXPECT_DOUBLE_EQ(beyond[0].value, 4);
  EXPECT_NEAR(beyond[0].carried.high, 3.2767, 1e-12);
  EXPECT_FALSE(beyond[0].refused);
  EXPECT_FALSE(beyond[0].at_start);
  // With limits of its own it is refused, unless the type makes it plausible again.
  scenario =
      ScenarioWith({{.signal = "yaw_rad", .min = -3.2, .max = 3.2, .type = NumberType::kI16, .scale = 1e-4}});
  scenario.reference.path = HoverReference{.yaw_rad = 4};
  EXPECT_TRUE(PathBeyondRange(scenario, Model().signals()).at(0).refused);
}

// A receiver that gets each message is the judge: for random types, scales, limits and references, by the bytes.
TEST(MessageRange, EqualsWhatTheReceiverGets) {
  std::mt19937_64 random(5);
  const auto draw = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() % 1'000'001) / 1e6;
  };
  int beyond_count = 0, within_count = 0;
  for (int turn = 0; turn < 2000; ++turn) {
    const auto type = static_cast<NumberType>(random() % link::kNumberTypeCount);
    MessageField field = Field("x_m", type, std::pow(10, draw(-4, 1)));
    if (random() % 2 == 0) {
      field.min = draw(-20, 0);
      field.max = draw(0, 20);
    }
    Scenario scenario = ScenarioWith({field});
    const double x_m = draw(-30, 30);
    scenario.reference.path = HoverReference{.at_m = {x_m, 0, 1}};
    const link::Protocol& protocol = *scenario.link.protocol;
    link::Message message;
    const auto payload = protocol.Encode(protocol.messages[0], std::vector{x_m});
    const bool taken =
        protocol.Decode(Direction::kReference, payload.span(), message) == link::MessageStatus::kOk;
    const double error = taken ? std::abs(message.values[0] - x_m) : 1e9;
    const double rounding = link::IsInteger(type) ? field.scale : 1e-4;
    const auto beyond = PathBeyondRange(scenario, Model().signals());
    if (error > 1.01 * rounding && taken) {
      ASSERT_EQ(beyond.size(), 1U) << x_m << " " << field.scale;
      EXPECT_FALSE(beyond[0].refused);
    }
    if (taken && error <= 0.99 * rounding) {
      EXPECT_TRUE(beyond.empty()) << x_m << " " << field.scale;
    }
    if (!beyond.empty() && beyond[0].refused) {
      EXPECT_FALSE(taken) << x_m << " " << field.max;
    }
    ++(beyond.empty() ? within_count : beyond_count);
  }
  EXPECT_GT(beyond_count, 300);
  EXPECT_GT(within_count, 300);
}

// Each signal of the reference that changes and has no field, in the protocol's axes: in NED the vehicle's x is its y.
TEST(MessageRange, WhatNoReferenceMessageCarriesIsNamed) {
  const auto unheard = [](const std::vector<std::string>& carried, std::array<double, 3> at_m, double yaw_rad,
                          link::WorldAxes world = link::WorldAxes::kEnu) {
    std::vector<MessageField> fields;
    for (const std::string& signal : carried) fields.push_back(Field(signal, NumberType::kF32, 1));
    Scenario scenario = ScenarioWith(fields);
    link::Protocol protocol = *scenario.link.protocol;
    protocol.world = world;
    scenario.link.protocol = std::make_shared<link::Protocol>(protocol);
    scenario.initial_position_m = {0, 0, 2};
    scenario.reference.path = HoverReference{.at_m = at_m, .yaw_rad = yaw_rad};
    return UnheardReference(scenario);
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(unheard({}, {0, 0, 2}, 0), Names());
  EXPECT_EQ(unheard({}, {0, 0, 2}, 4 * std::acos(-1.0)), Names());
  EXPECT_EQ(unheard({"x_m", "y_m"}, {1, 1, 3}, 0.5), (Names{"z_m", "yaw_rad"}));
  EXPECT_EQ(unheard({"x_m", "z_m"}, {1, 0, 3}, 0), Names());
  EXPECT_EQ(unheard({"x_m", "z_m"}, {1, 0, 3}, 0, link::WorldAxes::kNed), Names{"y_m"});
  EXPECT_EQ(unheard({}, {1, 2, 2}, 0), (Names{"x_m", "y_m"}));
}

// A value that a sensor's fault has made is the fault's doing, not the range's.
TEST(MessageRange, AFieldIsNamedOnceWhenTheVehicleItselfLeavesItsRange) {
  MessageField height = Field("z_m", NumberType::kI16, 0.01), speed = Field("vz_m_s", NumberType::kF32, 1);
  height.min = -10;
  height.max = 10;
  const Scenario scenario = ScenarioWith({}, {speed, height});
  const link::Protocol& protocol = *scenario.link.protocol;
  RangeWatch watch(protocol);
  const auto look = [&](std::vector<double> sent, std::vector<double> true_values) {
    return watch.Look(protocol.messages[1], sent, [&] { return true_values; });
  };
  using Texts = std::vector<std::string>;
  EXPECT_EQ(look({1e30, 10}, {1e30, 10}), Texts());
  EXPECT_EQ(look({0, 12}, {0, 9}), Texts());
  EXPECT_EQ(look({0, 10.004}, {0, 10.004}), Texts());  // 10.00 on the line
  EXPECT_EQ(look({0, 9}, {0, 12}), Texts());
  EXPECT_EQ(look({0, 12}, {0, 11}), Texts{"z_m = 12, beyond the range -10 to 10"});
  EXPECT_EQ(look({0, -11}, {0, -11}), Texts());
}

TEST(MessageRange, TheWorstOfAPathHasItsTime) {
  Scenario scenario =
      ScenarioWith({Field("y_m", NumberType::kI8, 0.01)}, {Field("x_m", NumberType::kI8, 0.03)});
  // x of the circle is 5 at 0 s and -5 at half the period, and y 5 at a quarter of it.
  scenario.reference.path = CircleReference{.radius_m = 5, .period_s = 8, .start_m = {5, 0, 1}};
  scenario.initial_position_m = {5, 0, 1};
  const auto beyond = PathBeyondRange(scenario, Model().signals());
  ASSERT_EQ(beyond.size(), 2U);
  const Trajectory trajectory(scenario.reference);
  for (const BeyondRange& each : beyond) {
    const std::size_t axis = each.field->signal == "x_m" ? 0 : 1;
    EXPECT_NEAR(std::abs(each.value), 5, 1e-4) << each.field->signal;
    if (!each.at_start) {
      EXPECT_EQ(trajectory.At(each.time_ns).position_m[axis], each.value);
    }
  }
  // A vehicle that is held stays at its start.
  scenario.held = true;
  scenario.initial_position_m = {0, 0, 1};
  EXPECT_EQ(PathBeyondRange(scenario, Model().signals()).size(), 1U);
  // A quarter of the path.
  scenario.duration_ns = kNsPerS;
  scenario.reference.path = CircleReference{.radius_m = 1.27, .period_s = 8, .start_m = {1.27, 0, 1}};
  EXPECT_TRUE(PathBeyondRange(scenario, Model().signals()).empty());
}

TEST(MessageRange, AStartBeyondTheFieldOfTheStateIsFoundInTheProtocolsAxes) {
  Scenario scenario =
      ScenarioWith({}, {Field("y_m", NumberType::kI8, 0.1), Field("wx_rad_s", NumberType::kU8, 1)});
  auto ned = std::make_shared<link::Protocol>(*scenario.link.protocol);
  ned->world = link::WorldAxes::kNed;
  scenario.link.protocol = ned;
  scenario.initial_position_m = {-20, 0, 1};  // x east is y of north, east, down
  const auto beyond = PathBeyondRange(scenario, Model().signals());
  ASSERT_EQ(beyond.size(), 1U);
  EXPECT_TRUE(beyond[0].at_start);
  EXPECT_EQ(beyond[0].value, -20);
  EXPECT_NEAR(beyond[0].carried.low, -12.8, 1e-12);
}

TEST(MessageRange, HoverMustBeWithinTheFieldsOfTheInputs) {
  const std::vector<double>& hover = Model().HoverInput();
  const VehicleSignals signals = Model().signals();
  const double f_r_n = hover.at(0);
  const auto found = [&](MessageField field) {
    return HoverBeyondRange(*ScenarioWith({}, {}, {std::move(field)}).link.protocol, signals, hover).size();
  };
  MessageField field = Field("f_r_n", NumberType::kF32, 1);
  field.max = 1.01 * f_r_n;
  EXPECT_EQ(found(field), 0U);
  field.max = 0.99 * f_r_n;
  EXPECT_EQ(found(field), 1U);
  // A share of the largest thrust.
  field.as = link::ThrustUnit::kShare;
  field.max = 0.99 * f_r_n / signals.inputs[0].max;
  EXPECT_EQ(found(field), 1U);
  field.max = 1.01 * f_r_n / signals.inputs[0].max;
  EXPECT_EQ(found(field), 0U);
}

}  // namespace
}  // namespace tiltproof::harness
