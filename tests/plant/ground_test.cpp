// Ground that carries the vehicle: standing, friction, touching down, taking off. The expected values follow from
// statics, Coulomb's law and free fall by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "plant/dynamics.h"
#include "plant/plant.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

const PlantOptions kSolidGround{.touch_down_max_m_s = 1};

CollisionShape BoxShape(const Vector3d& size_m, const Vector3d& p_m = Vector3d::Zero()) {
  return {.link = "body", .hinge = {}, .size_m = size_m, .p_LS_m = p_m};
}

// Flat, so that a push slides it and does not tip it. Its size goes with the cube root of its mass.
VehicleModel FlatQuadrotor(double mass_kg) {
  const double size_m = 0.4 * std::cbrt(mass_kg);
  VehicleModel model;
  model.name = "quadrotor";
  model.base.link = "body";
  model.base.mass_kg = mass_kg;
  model.base.inertia_kg_m2 = Vector3d(0.02, 0.02, 0.03).asDiagonal() * (mass_kg * size_m * size_m);
  for (int i = 0; i < 4; ++i)
    model.rotors.push_back({.name = "r" + std::to_string(i),
                            .hinge = {},
                            .p_LR_m = 0.5 * size_m * Vector3d(i < 2 ? 1 : -1, i % 2 == 0 ? 1 : -1, 0.1),
                            .direction = i == 0 || i == 3 ? 1.0 : -1.0,
                            .drag_ratio_m = 0.02,
                            .force_max_n = mass_kg * kGravity_m_s2});
  model.shapes = {BoxShape({size_m, size_m, 0.1 * size_m})};
  model.hover = SolveHover(model);
  return model;
}

struct Ground {
  explicit Ground(const VehicleModel& model, const PlantOptions& options = kSolidGround)
      : plant(model, options), state(model.signals().states.size()), input(model.signals().inputs.size()) {
    plant.ResetOnGround(0, 0, {0, 0, 0});
  }
  Vector3d Position() {
    plant.State(state);
    return {state[0], state[1], state[2]};
  }
  Vector3d Velocity() {  // of a vehicle without hinges
    plant.State(state);
    return {state[6], state[7], state[8]};
  }

  Plant plant;
  std::vector<double> state, input;
};

TEST(Ground, VehiclesOfAnyMassStandStill) {
  for (const double mass_kg : {0.03, 0.3, 1.5, 30.0}) {
    for (const TimeNs step_ns : {kNsPerMs, 4 * kNsPerMs, 12 * kNsPerMs}) {
      Ground ground(FlatQuadrotor(mass_kg), {.step_ns = step_ns, .touch_down_max_m_s = 1});
      const Vector3d start_m = ground.Position();
      double away_m = 0;
      for (TimeNs t = 0; t < 10 * kNsPerS; t += step_ns) {
        ground.plant.Step(ground.input);
        EXPECT_TRUE(ground.plant.OnGround()) << mass_kg << ' ' << step_ns << ' ' << t;
        away_m = std::max(away_m, (ground.Position() - start_m).norm());
      }
      EXPECT_LT(away_m, 1e-4) << mass_kg << ' ' << step_ns;
      EXPECT_NEAR(ground.state[3], 0, 1e-6);
      EXPECT_NEAR(ground.state[5], 0, 1e-6);
      EXPECT_EQ(ground.plant.Event(), FlightEvent::kNone) << ground.plant.EventText();
    }
  }
}

TEST(Ground, PushSlidesAboveCoulombsLimitInEveryDirection) {
  for (const double mass_kg : {0.03, 1.5, 30.0}) {
    const VehicleModel model = FlatQuadrotor(mass_kg);
    for (const double heading : {0.0, 0.3, std::numbers::pi / 4, 2.0, 4.4}) {
      const auto slid_m = [&](double part_of_weight) {
        Ground ground(model);
        const Vector3d start_m = ground.Position();
        const double force_n = part_of_weight * mass_kg * kGravity_m_s2;
        const Disturbance push{.force_n = {force_n * std::cos(heading), force_n * std::sin(heading), 0}};
        for (int i = 0; i < 250; ++i) ground.plant.Step(ground.input, push);
        const Vector3d way_m = ground.Position() - start_m;
        EXPECT_EQ(ground.plant.Event(), FlightEvent::kNone) << ground.plant.EventText();
        if (way_m.norm() > 0.01) {
          EXPECT_NEAR(std::remainder(std::atan2(way_m.y(), way_m.x()) - heading, 2 * std::numbers::pi), 0,
                      0.01);
        }
        return way_m.norm();
      };
      EXPECT_LT(slid_m(0.4), 1e-4) << mass_kg << ' ' << heading;
      EXPECT_LT(slid_m(0.79), 1e-4) << mass_kg << ' ' << heading;
      // (0.85 - 0.8) g t^2 / 2, and so on.
      EXPECT_NEAR(slid_m(0.85), 0.5 * 0.05 * kGravity_m_s2, 0.004) << mass_kg << ' ' << heading;
      EXPECT_NEAR(slid_m(1.2), 0.5 * 0.4 * kGravity_m_s2, 0.02) << mass_kg << ' ' << heading;
    }
  }
}

TEST(Ground, FallTouchesWithItsSpeed) {
  const VehicleModel model = FlatQuadrotor(1.5);
  for (const double height_m : {0.02, 0.1, 0.5, 2.0}) {
    const double speed_m_s = std::sqrt(2 * kGravity_m_s2 * height_m), step_s = 0.004;
    const auto event = [&](double limit_m_s) {
      Ground ground(model, {.touch_down_max_m_s = limit_m_s});
      const double stands_m = ground.Position().z();
      ground.plant.Reset({0, 0, stands_m + height_m}, {0, 0, 0});
      EXPECT_NEAR(ground.plant.Clearance_m(), height_m, 1e-6);
      EXPECT_FALSE(ground.plant.OnGround());
      double top_m = -1;
      bool touched = false;
      for (int i = 0; i < 500; ++i) {
        ground.plant.Step(ground.input);
        if (touched) top_m = std::max(top_m, ground.plant.Clearance_m());
        touched = touched || ground.plant.OnGround();
      }
      EXPECT_TRUE(touched);
      EXPECT_LT(top_m, 1e-4) << "bounces";
      EXPECT_TRUE(ground.plant.OnGround());
      EXPECT_NEAR(ground.Position().z(), stands_m, 1e-5);
      return ground.plant.EventText();
    };
    EXPECT_EQ(event(speed_m_s + 1.01 * kGravity_m_s2 * step_s), "") << height_m;
    EXPECT_THAT(event(speed_m_s - 1.01 * kGravity_m_s2 * step_s), HasSubstr("'body' touches the ground"))
        << height_m;
  }
}

TEST(Ground, TouchNamesSpeedAndLimit) {
  Ground ground(FlatQuadrotor(1.5));
  ground.plant.Reset({1, 2, 0.5}, {0, 0, 0});
  while (ground.plant.Event() == FlightEvent::kNone) ground.plant.Step(ground.input);
  EXPECT_EQ(ground.plant.Event(), FlightEvent::kGroundStrike);
  EXPECT_THAT(
      ground.plant.EventText(),
      ::testing::MatchesRegex("'body' touches the ground at \\(.*\\) m with 3\\.0.. m/s, limit 1 m/s"));
}

TEST(Ground, TouchOnItsSideIsAStrike) {
  VehicleModel model = FlatQuadrotor(1.5);
  model.shapes = {
      {.link = "body", .hinge = {}, .kind = CollisionShape::Kind::kSphere, .size_m = {0.2, 0, 0}}};
  Ground ground(model);
  for (const double tilt_rad : {-1.04, 1.04}) {
    ground.plant.ResetOnGround(0, 0, {tilt_rad, 0, 0});
    EXPECT_EQ(ground.plant.Event(), FlightEvent::kNone) << ground.plant.EventText();
    ground.plant.ResetOnGround(0, 0, {0, tilt_rad * 1.02, 0});
    EXPECT_EQ(ground.plant.Event(), FlightEvent::kGroundStrike);
    EXPECT_THAT(ground.plant.EventText(), HasSubstr("tilted by 60.8 deg, limit 60 deg"));
  }
}

// Points on the surface of the shape, in its own frame.
std::vector<Vector3d> SurfaceOf(const CollisionShape& shape) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 2000; ++i) {
    const double turn = i * 2 * std::numbers::pi / 2000;
    for (int k = 0; k <= 100 && shape.kind == CollisionShape::Kind::kSphere && i % 20 == 0; ++k) {
      const double up = std::numbers::pi * k / 100;
      points.push_back(shape.size_m.x() *
                       Vector3d(std::sin(up) * std::cos(turn), std::sin(up) * std::sin(turn), std::cos(up)));
    }
    for (const double end : {-0.5, 0.5}) {
      if (shape.kind == CollisionShape::Kind::kCylinder)
        points.push_back(
            {shape.size_m.x() * std::cos(turn), shape.size_m.x() * std::sin(turn), end * shape.size_m.y()});
      if (shape.kind == CollisionShape::Kind::kBox && i < 4)
        points.push_back(
            {(i % 2 - 0.5) * shape.size_m.x(), (i / 2 - 0.5) * shape.size_m.y(), end * shape.size_m.z()});
    }
  }
  return points;
}

TEST(Ground, StartsWhereTheLowestPointTouches) {
  VehicleModel model = FlatQuadrotor(1.5);
  const Matrix3d turn =
      (Eigen::AngleAxisd(0.7, Vector3d::UnitX()) * Eigen::AngleAxisd(0.4, Vector3d::UnitY()))
          .toRotationMatrix();
  const Vector3d place(0.1, -0.3, 0.2);
  std::vector<CollisionShape> shapes = {BoxShape({0.3, 0.5, 0.2}), BoxShape({0.1, 0.2, 0.3}, place), {}, {}};
  shapes[2] = {.kind = CollisionShape::Kind::kSphere, .size_m = {0.25, 0, 0}, .p_LS_m = place};
  shapes[3] = {.kind = CollisionShape::Kind::kCylinder, .size_m = {0.1, 0.5, 0}, .p_LS_m = -place};
  for (CollisionShape& shape : shapes) {
    shape.R_LS = turn;
    model.shapes = {shape};
    for (const Vector3d& angles : {Vector3d(0, 0, 0), Vector3d(0.2, -0.5, 1), Vector3d(-0.9, 0.3, -2)}) {
      Ground ground(model);
      ground.plant.ResetOnGround(3, 4, {angles[0], angles[1], angles[2]});
      const Matrix3d R =
          (Eigen::AngleAxisd(angles[2], Vector3d::UnitZ()) * Eigen::AngleAxisd(angles[1], Vector3d::UnitY()) *
           Eigen::AngleAxisd(angles[0], Vector3d::UnitX()))
              .toRotationMatrix();
      double lowest_m = 10;
      for (const Vector3d& point : SurfaceOf(shape))
        lowest_m = std::min(lowest_m, (R * (shape.p_LS_m + shape.R_LS * point)).z());
      EXPECT_NEAR(ground.Position().x(), 3, 1e-12);
      EXPECT_NEAR(ground.Position().y(), 4, 1e-12);
      // The sphere's points are a degree apart.
      const bool is_sphere = shape.kind == CollisionShape::Kind::kSphere;
      EXPECT_NEAR(ground.Position().z(), -lowest_m, is_sphere ? 1e-4 : 2e-6);
      EXPECT_NEAR(ground.plant.Clearance_m(), 0, 2e-9);
      EXPECT_TRUE(ground.plant.OnGround());
    }
  }
}

TEST(Ground, RampTakesOffWhenItCarriesTheWeight) {
  const double mass_kg = 1.5, step_s = 0.004, rise_n_s = 10;
  Ground ground(FlatQuadrotor(mass_kg));
  const double stands_m = ground.Position().z();
  const double off_s = mass_kg * kGravity_m_s2 / rise_n_s;
  for (int i = 0; i < 500; ++i) {
    const double t_s = i * step_s;
    ground.input.assign(4, rise_n_s * t_s / 4);
    ground.plant.Step(ground.input);
    if (t_s < off_s - 0.01) {
      EXPECT_TRUE(ground.plant.OnGround()) << t_s;
    }
    // From then on z'' = rise (t - off) / m.
    const double after_s = std::max(0.0, t_s + step_s - off_s);
    EXPECT_NEAR(ground.Position().z() - stands_m, rise_n_s * std::pow(after_s, 3) / (6 * mass_kg),
                0.002 + 0.01 * after_s)
        << t_s;
  }
  EXPECT_GT(ground.Position().z(), stands_m + 0.1);
  EXPECT_FALSE(ground.plant.OnGround());
  // Thrust that falls short of the weight lets it down again, and cut, it stands.
  while (!ground.plant.OnGround()) {
    ground.input.assign(
        4, ground.Velocity().z() < -0.3 ? mass_kg * kGravity_m_s2 / 4 : mass_kg * kGravity_m_s2 / 8);
    ground.plant.Step(ground.input);
  }
  ground.input.assign(4, 0);
  for (int i = 0; i < 500; ++i) {
    ground.plant.Step(ground.input);
    EXPECT_TRUE(ground.plant.OnGround());
  }
  EXPECT_EQ(ground.plant.Event(), FlightEvent::kNone) << ground.plant.EventText();
  EXPECT_NEAR(ground.Position().z(), stands_m, 1e-5);
  EXPECT_NEAR(ground.Velocity().norm(), 0, 1e-6);
}

// The shipped vehicle on a leg of each thruster alone.
TEST(Ground, ShapesOnHingesCarryTheVehicle) {
  VehicleModel model = LoadShipped("tiltrotor");
  model.shapes.at(0).p_LS_m.z() += 0.1;
  for (const std::size_t hinge : {0u, 1u})
    model.shapes.push_back(
        {.link = "leg", .hinge = hinge, .kind = CollisionShape::Kind::kBox, .size_m = {0.3, 0.05, 0.3}});
  Ground ground(model);
  // Legs of 0.15 m below the hinges, which lie 0.05621 m above the origin and are tilted by 5 deg.
  const double beta = 5 * std::numbers::pi / 180, alpha = model.hover.hinge_rad[0];
  const double below_m =
      std::cos(beta) * (0.15 * std::cos(alpha) + 0.15 * std::sin(alpha)) + 0.025 * std::sin(beta);
  EXPECT_NEAR(ground.Position().z(), below_m - 0.05621, 2e-4);
  EXPECT_TRUE(ground.plant.OnGround());
  for (int i = 0; i < 500; ++i) ground.plant.Step(model.HoverInput());
  EXPECT_EQ(ground.plant.Event(), FlightEvent::kNone) << ground.plant.EventText();
  EXPECT_LT(ground.plant.HingeGap(), 1e-4);
  // A touch of a leg ends a flight whose ground does not carry.
  Plant other(model, {});
  other.Reset({0, 0, ground.Position().z() - 0.01}, {0, 0, 0});
  EXPECT_THAT(other.EventText(), HasSubstr("'leg' touches the ground"));
}

// Hinges that turn fast divide a step. A touch inside it is as hard as one at its end.
TEST(Ground, HardTouchInADividedStepCounts) {
  const VehicleModel model = LoadShipped("tiltrotor");
  for (int i = 0; i < 20; ++i) {
    Ground ground(model);
    const double height_m = 0.3 + 0.0137 * i;
    ground.plant.Reset({0, 0, ground.Position().z() + height_m}, {0, 0, 0});
    for (int k = 0; k < 100 && ground.plant.Event() == FlightEvent::kNone; ++k) {
      const double torque_nm = k / 3 % 2 == 0 ? 2 : -2;  // to the stops and back
      ground.plant.Step(std::vector<double>{0, 0, torque_nm, -torque_nm});
    }
    ASSERT_EQ(ground.plant.Event(), FlightEvent::kGroundStrike) << height_m;
    const std::string text = ground.plant.EventText();
    EXPECT_NEAR(std::stod(text.substr(text.find(" with ") + 6)), std::sqrt(2 * kGravity_m_s2 * height_m),
                0.06)
        << text;
  }
}

TEST(Ground, SameCallsSameBits) {
  std::vector<std::vector<double>> ends;
  for (int repeat = 0; repeat < 2; ++repeat) {
    Ground ground(LoadShipped("tiltrotor"));
    std::vector<double>& all = ends.emplace_back();
    for (int i = 0; i < 1500; ++i) {  // hops and tumbles
      const double force_n = i / 100 % 2 == 0 ? 11 : 5;
      ground.plant.Step(std::vector<double>{force_n, force_n + 0.3, 0.001 * std::sin(0.1 * i), 0});
      ground.plant.State(ground.state);
      all.insert(all.end(), ground.state.begin(), ground.state.end());
    }
  }
  EXPECT_EQ(ends[0], ends[1]);
}

}  // namespace
}  // namespace tiltproof::plant
