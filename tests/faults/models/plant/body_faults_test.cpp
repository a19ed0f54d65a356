// Faults that are one constant disturbance: what they say in their window, and nothing outside.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

using Vector = std::array<double, 3>;
using Parameter = std::map<std::string, ParameterValue>;

// Checks that a fault from 4 ms to 12 ms says `expected` there, once.
void ExpectSays(const std::string& type, const Parameter& parameters, const Disturbance& expected,
                const std::string& text) {
  FaultSchedule schedule = AtThePlant({At(Spec(type, parameters), 4 * kNsPerMs, 12 * kNsPerMs)});
  EXPECT_EQ(schedule.DisturbanceOf(0), Disturbance{});
  EXPECT_EQ(schedule.DisturbanceOf(4 * kNsPerMs), expected);
  EXPECT_EQ(schedule.DisturbanceOf(8 * kNsPerMs), expected);
  EXPECT_EQ(schedule.DisturbanceOf(12 * kNsPerMs), Disturbance{});
  EXPECT_THAT(schedule.ActivationCounts(), ::testing::ElementsAre(1));
  EXPECT_EQ(schedule.TakeActivations(kOriginAtPowerOn).at(0).what, text);
}

TEST(TorqueTest, TurnsAboutAnAxisOfTheBody) {
  Disturbance expected;
  expected.torque_body_nm = {0, -0.25, 0};
  ExpectSays("plant.torque", {{"torque_nm", -0.25}, {"axis", "y"}}, expected,
             "torque 0 -0.25 0 N m about the body's axes");
}

TEST(MassTest, IsAFactor) {
  Disturbance expected;
  expected.mass_factor = 1.25;
  ExpectSays("plant.mass", {{"factor", 1.25}}, expected, "mass times 1.25");
}

TEST(InertiaTest, IsAFactor) {
  Disturbance expected;
  expected.inertia_factor = 0.5;
  ExpectSays("plant.inertia", {{"factor", 0.5}}, expected, "inertia times 0.5");
}

TEST(ComShiftTest, GoesAlongItsDirection) {
  Disturbance expected;
  expected.com_shift_m = {0.3, 0, -0.4};
  ExpectSays("plant.com_shift", {{"shift_m", 0.5}, {"direction", Vector{3.0, 0.0, -4.0}}}, expected,
             "centre of mass shifted by 0.3 0 -0.4 m");
}

TEST(ThrustTest, IsOfOneRotorByItsName) {
  Disturbance expected;
  expected.thrust_factor[1] = 0.75;
  ExpectSays("plant.thrust", {{"rotor", "left"}, {"factor", 0.75}}, expected, "thrust of rotor 1 times 0.75");
}

TEST(ServoJamTest, HoldsOneJointByItsName) {
  Disturbance expected;
  expected.hinges[1] = {.held = true, .rate_rad_s = 0};
  ExpectSays("plant.servo_jam", {{"joint", "hinge_left"}}, expected, "hinge 1 at 0 rad/s");
}

TEST(ServoRunawayTest, TurnsOneJoint) {
  Disturbance expected;
  expected.hinges[0] = {.held = true, .rate_rad_s = -0.5};
  ExpectSays("plant.servo_runaway", {{"joint", "hinge_right"}, {"rate_rad_s", -0.5}}, expected,
             "hinge 0 at -0.5 rad/s");
}

// A joint that is told to run away with rate 0 is not jammed.
TEST(ServoRunawayTest, AtRateZeroFollowsItsServo) {
  FaultSchedule schedule =
      AtThePlant({Spec("plant.servo_runaway", {{"joint", "hinge_right"}, {"rate_rad_s", 0.0}})});
  EXPECT_EQ(schedule.DisturbanceOf(0), Disturbance{});
}

TEST(PartTest, OneThatTheVehicleLacksIsRefused) {
  EXPECT_THROW(AtThePlant({Spec("plant.servo_jam", {{"joint", "hinge"}})}), std::invalid_argument);
  EXPECT_THROW(AtThePlant({Spec("plant.thrust", {{"rotor", "r"}, {"factor", 0.5}})}), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::faults
