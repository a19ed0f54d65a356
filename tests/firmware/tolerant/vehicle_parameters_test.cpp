// The firmware's parameters of its vehicle equal those of the shipped model file.
#include "firmware/tolerant/vehicle_parameters.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::firmware {
namespace {

constexpr double kRelative = 1e-12;

plant::VehicleModel ShippedTiltrotor() {
  std::vector<std::string> warnings;
  return plant::LoadVehicle(TILTPROOF_SOURCE_DIR "/plant/models/tiltrotor.sdf", {}, warnings);
}

void ExpectSame(double own, double of_model, const char* what) {
  EXPECT_NEAR(own, of_model, kRelative * std::abs(of_model) + 1e-18) << what;
}

TEST(VehicleParametersTest, TheMainBodyIsTheModels) {
  const plant::RigidBody body = ShippedTiltrotor().base;
  ExpectSame(kTiltrotor.mass_kg, body.mass_kg, "mass");
  for (int axis = 0; axis < 3; ++axis) {
    ExpectSame(kTiltrotor.p_com_m.at(static_cast<std::size_t>(axis)), body.p_com_m[axis], "centre of mass");
  }
  const Eigen::Matrix3d& i = body.inertia_kg_m2;
  const std::array<double, 6> entries = {i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)};
  for (std::size_t entry = 0; entry < 6; ++entry) {
    ExpectSame(kTiltrotor.inertia_kg_m2.at(entry), entries.at(entry), "inertia");
  }
}

TEST(VehicleParametersTest, TheThrustersAreTheModels) {
  const plant::VehicleModel model = ShippedTiltrotor();
  for (std::size_t k = 0; k < 2; ++k) {
    const Thruster& own = kTiltrotor.thrusters.at(k);
    const plant::Hinge& thruster = model.hinges.at(k);
    const plant::Rotor& rotor = model.rotors.at(k);
    EXPECT_EQ(rotor.hinge, k);
    EXPECT_TRUE(rotor.p_LR_m.isZero());
    ExpectSame(own.mass_kg, thruster.body.mass_kg, "mass");
    EXPECT_TRUE(thruster.body.p_com_m.isZero()) << "the equations assume a centre of mass on the hinge";
    EXPECT_TRUE(thruster.p_BH_m.isApprox(thruster.p_BT_m, 1e-12)) << "and the link's origin there";
    const Eigen::Matrix3d& inertia = thruster.body.inertia_kg_m2;
    EXPECT_TRUE(inertia.isDiagonal());
    for (int axis = 0; axis < 3; ++axis) {
      ExpectSame(own.p_BT_m.at(static_cast<std::size_t>(axis)), thruster.p_BT_m[axis], "hinge");
      ExpectSame(own.inertia_kg_m2.at(static_cast<std::size_t>(axis)), inertia(axis, axis), "inertia");
    }
    const Eigen::Matrix3d cant = Eigen::AngleAxisd(own.cant_rad, Eigen::Vector3d::UnitX()).toRotationMatrix();
    EXPECT_TRUE(thruster.R_BT.isApprox(cant, 1e-12));
    EXPECT_TRUE(thruster.axis_B.isApprox(cant.col(1), 1e-12));
    EXPECT_TRUE(rotor.thrust_axis_L.isApprox(Eigen::Vector3d::UnitZ(), 1e-12));
    ExpectSame(own.direction, rotor.direction, "direction");
    ExpectSame(kTiltrotor.drag_ratio_m, rotor.drag_ratio_m, "drag ratio");
    ExpectSame(kTiltrotor.force_max_n, rotor.force_max_n, "thrust");
    ExpectSame(0, rotor.force_min_n, "thrust");
    ExpectSame(kTiltrotor.torque_max_nm, thruster.torque_max_nm, "torque");
    ExpectSame(kTiltrotor.angle_max_rad, thruster.angle_max_rad, "stop");
    ExpectSame(-kTiltrotor.angle_max_rad, thruster.angle_min_rad, "stop");
  }
}

TEST(VehicleParametersTest, ConstantsAreTheWholeVehicles) {
  const plant::VehicleModel model = ShippedTiltrotor();
  Eigen::Vector3d p_BC_m = model.base.mass_kg * model.base.p_com_m;
  for (const plant::Hinge& thruster : model.hinges) {
    p_BC_m += thruster.body.mass_kg * thruster.p_BT_m;
  }
  p_BC_m /= model.MassTotal();
  EXPECT_NEAR(kTiltrotorConstants.mass_kg, model.MassTotal(), 2e-7);
  EXPECT_NEAR(kTiltrotorConstants.p_BC_m.x, p_BC_m.x(), 1e-9);
  EXPECT_NEAR(kTiltrotorConstants.p_BC_m.y, p_BC_m.y(), 1e-9);
  EXPECT_NEAR(kTiltrotorConstants.p_BC_m.z, p_BC_m.z(), 1e-9);
  Eigen::Matrix3d inertia = model.base.inertia_kg_m2;
  const auto add = [&](double mass_kg, const Eigen::Vector3d& p_CB) {
    inertia += mass_kg * (p_CB.squaredNorm() * Eigen::Matrix3d::Identity() - p_CB * p_CB.transpose());
  };
  add(model.base.mass_kg, model.base.p_com_m - p_BC_m);
  for (const plant::Hinge& thruster : model.hinges) add(thruster.body.mass_kg, thruster.p_BT_m - p_BC_m);
  const Symmetric3& own = kTiltrotorConstants.inertia_kg_m2;
  EXPECT_NEAR(own.xx, inertia(0, 0), 1e-8);
  EXPECT_NEAR(own.yy, inertia(1, 1), 1e-8);
  EXPECT_NEAR(own.zz, inertia(2, 2), 1e-8);
  EXPECT_NEAR(own.xy, inertia(0, 1), 1e-8);
  EXPECT_NEAR(own.xz, inertia(0, 2), 1e-8);
  EXPECT_NEAR(own.yz, inertia(1, 2), 1e-8);
}

}  // namespace
}  // namespace tiltproof::firmware
