// Vehicles from the files that their owners have: includes, motor plugins, and what carries no rotor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <fstream>

#include "plant/vehicle_mapping.h"
#include "plant/vehicle_model.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class VehicleFolder : public ::testing::Test {
 protected:
  VehicleFolder() { std::filesystem::create_directories(folder_); }
  ~VehicleFolder() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& file, const std::string& text) {
    std::filesystem::create_directories((folder_ / file).parent_path());
    std::ofstream(folder_ / file) << text;
  }
  VehicleModel Load(const std::filesystem::path& file) {
    warnings_.clear();
    return LoadVehicle(file.is_absolute() ? file : folder_ / file, {}, warnings_);
  }
  std::string Error(const std::filesystem::path& file) {
    try {
      Load(file);
      ADD_FAILURE() << "loaded";
      return {};
    } catch (const VehicleError& error) {
      return error.what();
    }
  }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                  ("tiltproof-vehicles-" + std::to_string(::getpid()) + "-" +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  std::vector<std::string> warnings_;
};

std::filesystem::path Case(const std::string& name) { return SourceFile("tests/plant/vehicles/" + name); }

// Files that users bring.
TEST_F(VehicleFolder, HeavyVehicleIsRefusedWithNeedAndLimit) {
  // (19.25 + 2 * 0.0809) kg * 9.81 m/s^2 / 2 rotors, about equal.
  EXPECT_THAT(Error(Case("tooheavy.sdf")),
              AllOf(HasSubstr("has to give 95.53 N"), HasSubstr("limits are 0 to 30 N")));
}
TEST_F(VehicleFolder, LinkWithoutInertiaIsRefusedWithItsLine) {
  EXPECT_THAT(Error(Case("noinertia.sdf")),
              HasSubstr("noinertia.sdf:32: link 'thruster_right' has no <inertia>"));
}
TEST_F(VehicleFolder, StopAtZeroHolds) {
  const VehicleModel model = Load(Case("zerolower.sdf"));
  EXPECT_EQ(model.hinges[0].angle_min_rad, 0);
  EXPECT_EQ(model.hinges[1].angle_max_rad, 1.57);
  EXPECT_EQ(model.hover.input, LoadShipped("tiltrotor").hover.input);
}
TEST_F(VehicleFolder, FixedLoadIsAPartOfTheBody) {
  const VehicleModel model = Load(Case("withload.sdf"));
  EXPECT_THAT(
      warnings_,
      ElementsAre(HasSubstr("1 link that carries no rotor is fixed to what carries it (0.5 kg): load::box")));
  EXPECT_NEAR(model.base.mass_kg, 1.92509767079622 + 0.5, 1e-14);
  // (1.925... * -0.0181... + 0.5 * -0.1) kg m by the sum of the masses.
  EXPECT_NEAR(model.base.p_com_m.z(), (1.92509767079622 * -0.01819008141 - 0.05) / 2.42509767079622, 1e-15);
}
TEST_F(VehicleFolder, MergedModelFliesLikeTheModel) {
  const VehicleModel model = Load(Case("outer.sdf"));
  EXPECT_THAT(warnings_, IsEmpty());
  const VehicleModel plain = LoadShipped("tiltrotor");
  EXPECT_EQ(model.name, "outer");
  EXPECT_EQ(model.HoverInput(), plain.HoverInput());
  EXPECT_EQ(model.base.inertia_kg_m2, plain.base.inertia_kg_m2);
  EXPECT_EQ(model.hinges[1].p_BH_m, plain.hinges[1].p_BH_m);
  EXPECT_EQ(IncludedFiles(Case("outer.sdf")),
            (std::vector<std::filesystem::path>{Case("tr/model.sdf").lexically_normal()}));
}
TEST_F(VehicleFolder, RotorWithoutDragRatioFliesWithoutDragTorque) {
  const VehicleModel model = Load(Case("nodrag.sdf"));
  EXPECT_EQ(model.rotors[0].drag_ratio_m, 0);
  EXPECT_EQ(model.rotors[1].drag_ratio_m, 0);
  EXPECT_THAT(
      warnings_,
      ElementsAre(
          HasSubstr("nodrag.sdf:72: rotor 'right': without drag_ratio_m its propeller exerts no drag torque"),
          HasSubstr("nodrag.sdf:74: rotor 'left': without drag_ratio_m")));
}

std::string Body(const std::string& name, const std::string& pose, const std::string& mass,
                 const std::string& moments, const std::string& more = "") {
  std::string inertia;
  std::istringstream in(moments);
  for (const char* tag : {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"}) {
    std::string value;
    if (in >> value) inertia += std::string("<") + tag + ">" + value + "</" + tag + ">";
  }
  return "<link name='" + name + "'><pose>" + pose + "</pose><inertial>" + more + "<mass>" + mass +
         "</mass><inertia>" + inertia + "</inertia></inertial></link>\n";
}
std::string JointOf(const std::string& name, const std::string& type, const std::string& parent,
                    const std::string& child, const std::string& axis = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent>" + parent + "</parent><child>" + child +
         "</child>" + axis + "</joint>\n";
}
std::string Axis(const std::string& xyz, const std::string& limit = "") {
  return "<axis><xyz>" + xyz + "</xyz>" + (limit.empty() ? "" : "<limit>" + limit + "</limit>") + "</axis>";
}
std::string MotorPlugin(const std::string& scope, int number, const std::string& turning) {
  const std::string name = scope + "rotor_" + std::to_string(number);
  return "<plugin name='m" + std::to_string(number) + "' filename='libgazebo_motor_model.so'><jointName>" +
         name + "_joint</jointName><linkName>" + name + "</linkName><turningDirection>" + turning +
         "</turningDirection><timeConstantUp>0.0125</timeConstantUp><timeConstantDown>0.025</"
         "timeConstantDown>"
         "<maxRotVelocity>1000</maxRotVelocity><motorConstant>8e-06</motorConstant>"
         "<momentConstant>0.016</momentConstant><motorNumber>0</motorNumber></plugin>\n";
}
// A frame with four propellers that spin, as Gazebo has them.
std::string QuadrotorFrame() {
  std::string text = Body("base_link", "0 0 0.1 0 0 0", "1.5", "0.02 0.02 0.04");
  for (const auto& [i, place] :
       {std::pair{0, "0.2 -0.2 0.12"}, {1, "-0.2 0.2 0.12"}, {2, "0.2 0.2 0.12"}, {3, "-0.2 -0.2 0.12"}}) {
    const std::string name = "rotor_" + std::to_string(i);
    text += Body(name, std::string(place) + " 0 0 0", "0.005", "1e-5 1e-5 1.9e-5");
    text += JointOf(name + "_joint", "revolute", "base_link", name,
                    Axis("0 0 1", "<lower>-1e+16</lower><upper>1e+16</upper>"));
  }
  return text;
}
std::string QuadrotorPlugins(const std::string& scope = "") {
  return MotorPlugin(scope, 0, "ccw") + MotorPlugin(scope, 1, "ccw") + MotorPlugin(scope, 2, "cw") +
         MotorPlugin(scope, 3, "cw");
}
std::string Sdf(const std::string& model, const std::string& version = "1.6") {
  return "<sdf version='" + version + "'>\n<model name='vehicle'>\n" + model + "</model>\n</sdf>\n";
}

TEST_F(VehicleFolder, GazeboMotorModelsAreRotors) {
  Write("quad.sdf", Sdf(QuadrotorFrame() + QuadrotorPlugins()));
  const VehicleModel model = Load("quad.sdf");
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("\"base_link\">: no link has a usable collision shape")));
  EXPECT_EQ(model.base.link, "base_link");
  EXPECT_TRUE(model.hinges.empty());
  ASSERT_EQ(model.rotors.size(), 4U);
  const Rotor& rotor = model.rotors[0];
  EXPECT_EQ(rotor.name, "rotor_0");
  EXPECT_NEAR((rotor.p_LR_m - Vector3d(0.2, -0.2, 0.02)).norm(), 0, 1e-15);
  EXPECT_DOUBLE_EQ(rotor.force_max_n, 8);  // 8e-6 * 1000^2
  EXPECT_EQ(rotor.drag_ratio_m, 0.016);
  EXPECT_EQ(rotor.time_constant_up_s, 0.0125);
  EXPECT_EQ(rotor.time_constant_down_s, 0.025);
  // A propeller that turns counterclockwise pushes the body the other way round.
  EXPECT_EQ(rotor.direction, -1);
  EXPECT_EQ(model.rotors[3].direction, 1);
  for (const std::string& warning : warnings_) EXPECT_THAT(warning, Not(HasSubstr("LiftDrag")));
  for (const double force_n : model.HoverInput()) EXPECT_NEAR(force_n, 1.52 * 9.81 / 4, 1e-9);
}

TEST_F(VehicleFolder, NamesOfSimulatorsBecomeNamesOfSignals) {
  std::string text = Sdf(QuadrotorFrame() + QuadrotorPlugins());
  for (std::size_t at = text.find("rotor_"); at != std::string::npos; at = text.find("rotor_", at + 8))
    text.replace(at, 6, "cf/m");
  Write("cf.sdf", text);
  EXPECT_EQ(Load("cf.sdf").signals().inputs[2].name, "f_cf_m2_n");
}

TEST_F(VehicleFolder, PluginWithoutANumberNamesIt) {
  std::string text = Sdf(QuadrotorFrame() + QuadrotorPlugins());
  text.replace(text.find("<motorConstant>8e-06</motorConstant>"), 36, "");
  Write("quad.sdf", text);
  EXPECT_THAT(Error("quad.sdf"), AllOf(HasSubstr("rotor 'rotor_0': the plugin does not state force_max_n"),
                                       HasSubstr("--mapping` writes quad.tiltproof.xml")));
  const std::string mapping = VehicleMapping(folder_ / "quad.sdf");
  EXPECT_THAT(mapping, HasSubstr("force_max_n=\"FILL_IN\""));
  // The lags of the plugin, both of them.
  EXPECT_THAT(mapping, HasSubstr("time_constant_s=\"0.0125\" time_constant_down_s=\"0.025\"/>"));
  Write("quad.tiltproof.xml", mapping);
  EXPECT_THAT(Error("quad.sdf"), HasSubstr("'force_max_n' must be a number, is 'FILL_IN'"));
  std::string filled = mapping;
  filled.replace(filled.rfind("FILL_IN"), 7, "8");
  Write("quad.tiltproof.xml", filled);
  const VehicleModel model = Load("quad.sdf");
  EXPECT_EQ(model.rotors[0].force_max_n, 8);
  EXPECT_EQ(model.rotors[3].direction, 1);
  for (const std::string& warning : warnings_) EXPECT_THAT(warning, Not(HasSubstr("LiftDrag")));
}

// A quadrotor of which two arms tilt by a position controller.
std::string TiltingArms(const std::string& limit) {
  std::string text = QuadrotorFrame();
  for (const char* arm : {"0", "2"}) {
    const std::string joint = std::string("rotor_") + arm + "_joint' type='revolute'><parent>";
    text.replace(text.find(joint) + joint.size(), 9, std::string("arm_") + arm);
    text += Body(std::string("arm_") + arm, arm[0] == '0' ? "0.2 -0.2 0.1 0 0 0" : "0.2 0.2 0.1 0 0 0", "0.1",
                 "1e-4 1e-4 1e-4") +
            JointOf(std::string("tilt_") + arm, "revolute", "base_link", std::string("arm_") + arm,
                    Axis("0 1 0", limit)) +
            "<plugin name='gz::sim::systems::JointPositionController' filename='x'><joint_name>tilt_" + arm +
            "</joint_name></plugin>\n";
  }
  return Sdf(text + QuadrotorPlugins());
}

TEST_F(VehicleFolder, PositionControllerIsAPositionServo) {
  Write("tilt.sdf", TiltingArms("<lower>0</lower><upper>1.57</upper><velocity>3</velocity>"));
  const VehicleModel model = Load("tilt.sdf");
  ASSERT_EQ(model.hinges.size(), 2U);
  EXPECT_EQ(model.hinges[0].name, "rotor_0");
  EXPECT_EQ(model.hinges[0].servo, ServoMode::kPosition);
  EXPECT_EQ(model.hinges[0].speed_max_rad_s, 3);
  // The propeller is a part of the arm.
  EXPECT_NEAR(model.hinges[0].body.mass_kg, 0.105, 1e-15);
  EXPECT_EQ(model.rotors[0].hinge, 0U);
  EXPECT_FALSE(model.rotors[1].hinge);
  const Signal input = model.signals().inputs[4];
  EXPECT_EQ(input.name, "angle_rotor_0_rad");
  EXPECT_EQ(input.min, 0);
  EXPECT_EQ(input.max, 1.57);
}

// Hover is found to some 1e-8 rad, and the hinges stop at 0: one of both directions is beyond.
TEST_F(VehicleFolder, HoverAtAStopIsHover) {
  for (const char* axis : {"<xyz>0 1 0", "<xyz>0 -1 0"}) {
    std::string text = TiltingArms("<lower>0</lower><upper>1.57</upper><velocity>3</velocity>");
    for (std::size_t at = text.find("<xyz>0 1 0"); at != std::string::npos;
         at = text.find("<xyz>0 1 0", at + 1))
      text.replace(at, 10, axis);
    Write("tilt.sdf", text);
    EXPECT_EQ(Load("tilt.sdf").hinges.size(), 2U) << axis;
  }
}

TEST_F(VehicleFolder, ServoWithoutSpeedIsNamedAndFilledIn) {
  Write("tilt.sdf", TiltingArms("<lower>0</lower><upper>1.57</upper>"));
  EXPECT_THAT(Error("tilt.sdf"), AllOf(HasSubstr("joint 'tilt_0' is a hinge that carries a rotor"),
                                       HasSubstr("state its speed as <velocity>"), HasSubstr("--mapping`")));
  std::string mapping = VehicleMapping(folder_ / "tilt.sdf");
  EXPECT_THAT(mapping, HasSubstr("joint=\"tilt_2\" mode=\"position\" speed_max_rad_s=\"FILL_IN\""));
  for (std::size_t at = mapping.find("\"FILL_IN"); at != std::string::npos; at = mapping.find("\"FILL_IN"))
    mapping.replace(at + 1, 7, "2.5");
  Write("tilt.tiltproof.xml", mapping);
  const VehicleModel model = Load("tilt.sdf");
  EXPECT_EQ(model.hinges[1].speed_max_rad_s, 2.5);
  // The rotors are still those of the plugins.
  EXPECT_EQ(model.rotors[0].time_constant_down_s, 0.025);
}

// A bicopter whose left side comes first, with propellers that spin, a sensor on a joint, and poses that only the
// joints state.
std::string Bicopter() {
  std::string text =
      Body("base_link", "0 0 0 0 0 0", "0.4", "8e-4 1.2e-3 1.3e-3") +
      Body("imu", "0 0 0 0 0 0", "0.01", "1e-5 1e-5 1e-5") +
      JointOf("imu_joint", "revolute", "base_link", "imu", Axis("0 0 1", "<lower>0</lower><upper>0</upper>"));
  for (const auto& [side, y] : {std::pair<std::string, std::string>{"ccw", "0.15"}, {"cw", "-0.15"}}) {
    const std::string tilt = side + "_servo_joint", spin = side + "_mot_joint";
    std::string arm = Body(side + "_servo", "0 0 0 0 0 0", "0.05", "1e-5 1e-5 1e-5");
    std::string propeller = Body(side + "_mot", "0 0 0 0 0 0", "0.05", "1e-5 1e-5 1e-5");
    arm.replace(arm.find("<pose>"), 6, "<pose relative_to='" + tilt + "'>");
    propeller.replace(propeller.find("<pose>"), 6, "<pose relative_to='" + spin + "'>");
    text += arm + propeller +
            JointOf(tilt, "revolute", "base_link", side + "_servo",
                    "<pose relative_to='base_link'>0 " + y + " 0.05 0 0 0</pose>" +
                        Axis("0 1 0", "<lower>-0.8</lower><upper>0.8</upper>")) +
            JointOf(spin, "revolute", side + "_servo", side + "_mot",
                    "<pose relative_to='" + side + "_servo'>0 0 0.06 0 0 0</pose>" + Axis("0 0 1"));
  }
  return Sdf(text, "1.9");
}

TEST_F(VehicleFolder, MappingKnowsTheRightRotorByItsPlace) {
  Write("bi.sdf", Bicopter());
  const std::string error = Error("bi.sdf");
  const std::size_t right = error.find("name=\"right\" link=\"cw_mot\""),
                    left = error.find("name=\"left\" link=\"ccw_mot\"");
  EXPECT_LT(right, left) << error;
  EXPECT_NE(left, std::string::npos) << error;
  EXPECT_THAT(error, Not(HasSubstr("link=\"imu\"")));
  EXPECT_THAT(error, HasSubstr("servo joint=\"cw_servo_joint\""));
  EXPECT_THAT(error, Not(HasSubstr("servo joint=\"cw_mot_joint\"")));
  std::string mapping = VehicleMapping(folder_ / "bi.sdf");
  for (const auto& [name, value] : {std::pair<std::string, std::string>{"direction", "1"},
                                    {"drag_ratio_m", "0.02"},
                                    {"force_max_n", "9"},
                                    {"torque_max_nm", "1"}})
    for (std::size_t at; (at = mapping.find(name + "=\"FILL_IN")) != std::string::npos;)
      mapping.replace(at + name.size() + 2, 7, value);
  Write("bi.tiltproof.xml", mapping);
  EXPECT_EQ(Load("bi.sdf").hinges[0].joint, "cw_servo_joint");
  EXPECT_THAT(warnings_, Not(::testing::Contains(HasSubstr("exchange the names"))));
}

TEST_F(VehicleFolder, ARightRotorOnTheLeftIsNoted) {
  Write("bi.sdf", Bicopter());
  std::string mapping =
      "<tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'><tiltproof:base link='base_link'/>\n";
  for (const auto& [name, side] : {std::pair<std::string, std::string>{"right", "ccw"}, {"left", "cw"}})
    mapping += "<tiltproof:rotor name='" + name + "' link='" + side + "_mot' axis='0 0 1' direction='" +
               (side == "cw" ? "1" : "-1") +
               "' drag_ratio_m='0.02' force_min_n='0' force_max_n='9'/><tiltproof:servo joint='" + side +
               "_servo_joint' torque_max_nm='1'/>\n";
  Write("bi.tiltproof.xml", mapping + "</tiltproof:vehicle>\n");
  EXPECT_EQ(Load("bi.sdf").rotors.size(), 2U);
  EXPECT_THAT(warnings_,
              ::testing::Contains(
                  HasSubstr("bi.tiltproof.xml:2: rotor 'right' is at y = 0.15 m, to the left of rotor 'left' "
                            "at -0.15 m: exchange the names")));
}

TEST_F(VehicleFolder, TorqueServoByTheEffort) {
  std::string text = TiltingArms("<lower>-0.5</lower><upper>0.5</upper><effort>2</effort>");
  for (std::size_t at = text.find("JointPositionC"); at != std::string::npos;
       at = text.find("JointPositionC"))
    text.replace(at, 14, "JointForceC");
  Write("tilt.sdf", text);
  const VehicleModel model = Load("tilt.sdf");
  EXPECT_EQ(model.hinges[1].torque_max_nm, 2);
  EXPECT_EQ(model.signals().inputs[5].name, "tau_rotor_2_nm");
}

TEST_F(VehicleFolder, EqualStopsFixAHinge) {
  Write("tilt.sdf", TiltingArms("<lower>0</lower><upper>0</upper>"));
  const VehicleModel model = Load("tilt.sdf");
  EXPECT_TRUE(model.hinges.empty());
  EXPECT_NEAR(model.base.mass_kg, 1.5 + 4 * 0.005 + 2 * 0.1, 1e-14);
}

// Second moments of mass add up without the parallel axis theorem: an independent sum.
struct Moments {
  double mass_kg = 0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();

  void Add(double mass, const Vector3d& at, const Matrix3d& turn, const Vector3d& diagonal,
           const Vector3d& xy_xz_yz = Vector3d::Zero()) {
    Matrix3d inertia;
    inertia << diagonal[0], xy_xz_yz[0], xy_xz_yz[1], xy_xz_yz[0], diagonal[1], xy_xz_yz[2], xy_xz_yz[1],
        xy_xz_yz[2], diagonal[2];
    mass_kg += mass;
    first += mass * at;
    second += turn * (inertia.trace() / 2 * Matrix3d::Identity() - inertia) * turn.transpose() +
              mass * at * at.transpose();
  }
  Vector3d Com() const { return first / mass_kg; }
  Matrix3d Inertia() const {
    const Matrix3d about_com = second - mass_kg * Com() * Com().transpose();
    return about_com.trace() * Matrix3d::Identity() - about_com;
  }
};

Matrix3d Rpy(double roll, double pitch, double yaw) {
  return (Eigen::AngleAxisd(yaw, Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Vector3d::UnitX()))
      .toRotationMatrix();
}

// Chains of every kind of joint, turned links and turned inertial frames.
TEST_F(VehicleFolder, LumpedMassesEqualAHandCalculation) {
  const std::string axis = Axis("0 1 0", "<lower>-1</lower><upper>1</upper>");
  const std::string parts =
      Body("mount", "0.1 0.02 0 0.3 -0.2 0.7", "0.2", "0.003 0.004 0.005 0.0001 -0.0002 0.0003") +
      Body("gimbal", "0.1 0.02 -0.1 0 0 0", "0.07", "0.001 0.001 0.001",
           "<pose>0.01 0 0.02 0.4 0.5 0.6</pose>") +
      Body("flap", "-0.3 0.2 0 0 0 1.2", "0.03", "2e-4 3e-4 4e-4") +
      Body("leg", "0 0.3 -0.2 0 0 0", "0.11", "0.001 0.002 0.0025") +
      Body("load", "0 0 -0.7 0 0 0", "0.4", "0.01 0.01 0.01") +
      // Its axis is not read: a fixed joint has none.
      JointOf("a", "fixed", "base_link", "mount", Axis("0 0 0")) +
      JointOf("b", "universal", "mount", "gimbal") + JointOf("c", "revolute", "base_link", "flap", axis) +
      JointOf("d", "prismatic", "base_link", "leg", axis) + JointOf("e", "ball", "gimbal", "load");
  Write("quad.sdf", Sdf(QuadrotorFrame() + parts + QuadrotorPlugins()));
  const VehicleModel model = Load("quad.sdf");
  EXPECT_THAT(warnings_, ::testing::Contains(HasSubstr(
                             "5 links that carry no rotor are fixed to what carries them (0.81 kg): mount, "
                             "gimbal, flap, leg, load")));
  // In the frame of base_link, which is 0.1 m above the model's.
  Moments sum;
  const Vector3d down(0, 0, -0.1);
  sum.Add(1.5, Vector3d::Zero(), Matrix3d::Identity(), {0.02, 0.02, 0.04});
  for (const double x : {-0.2, 0.2})
    for (const double y : {-0.2, 0.2})
      sum.Add(0.005, Vector3d(x, y, 0.12) + down, Matrix3d::Identity(), {1e-5, 1e-5, 1.9e-5});
  sum.Add(0.2, Vector3d(0.1, 0.02, 0) + down, Rpy(0.3, -0.2, 0.7), {0.003, 0.004, 0.005},
          {0.0001, -0.0002, 0.0003});
  sum.Add(0.07, Vector3d(0.11, 0.02, -0.08) + down, Rpy(0.4, 0.5, 0.6), {0.001, 0.001, 0.001});
  sum.Add(0.03, Vector3d(-0.3, 0.2, 0) + down, Rpy(0, 0, 1.2), {2e-4, 3e-4, 4e-4});
  sum.Add(0.11, Vector3d(0, 0.3, -0.2) + down, Matrix3d::Identity(), {0.001, 0.002, 0.0025});
  sum.Add(0.4, Vector3d(0, 0, -0.7) + down, Matrix3d::Identity(), {0.01, 0.01, 0.01});
  EXPECT_NEAR(model.base.mass_kg, sum.mass_kg, 1e-12);
  EXPECT_NEAR((model.base.p_com_m - sum.Com()).norm(), 0, 1e-12);
  EXPECT_NEAR((model.base.inertia_kg_m2 - sum.Inertia()).norm(), 0, 1e-12);
}

TEST_F(VehicleFolder, LinkWithoutInertialHasNoMassAndIsNamed) {
  Write("quad.sdf", Sdf(QuadrotorFrame() + "<link name='camera_frame'/>" +
                        JointOf("a", "fixed", "base_link", "camera_frame") + QuadrotorPlugins()));
  EXPECT_NEAR(Load("quad.sdf").MassTotal(), 1.52, 1e-14);
  EXPECT_THAT(warnings_,
              ::testing::Contains(AllOf(
                  HasSubstr("1 link that carries no rotor"),
                  HasSubstr("(0 kg): camera_frame; without <inertial>, so without mass: camera_frame"))));
  // An <inertial> must be complete.
  Write("quad.sdf", Sdf(QuadrotorFrame() + "<link name='camera'><inertial><mass>1</mass></inertial></link>" +
                        JointOf("a", "fixed", "base_link", "camera") + QuadrotorPlugins()));
  EXPECT_THAT(Error("quad.sdf"), HasSubstr("link 'camera' has no <inertia>"));
}

TEST_F(VehicleFolder, TextThatIsNoNumberIsQuoted) {
  const auto error_with = [&](const std::string& from, const std::string& to) {
    std::string text = TiltingArms("<lower>0</lower><upper>1.57</upper><velocity>3</velocity>");
    text.replace(text.find(from), from.size(), to);
    Write("tilt.sdf", text);
    return Error("tilt.sdf");
  };
  EXPECT_THAT(error_with("<mass>1.5</mass>", "<mass>1,925</mass>"),
              HasSubstr("<mass>: '1,925' is not a number"));
  EXPECT_THAT(error_with("<pose>0 0 0.1 0 0 0", "<pose>0 0 0.1 0 0 pi/2"),
              HasSubstr("tilt.sdf:3: <pose>: 'pi/2' is not a number"));
  EXPECT_THAT(error_with("<xyz>0 1 0", "<xyz>0 1 O"), HasSubstr("<xyz>: 'O' is not a number"));
  EXPECT_THAT(error_with("<upper>1.57", "<upper>pi/2"), HasSubstr("<upper>: 'pi/2' is not a number"));
  EXPECT_THAT(error_with("<pose>0 0 0.1 0 0 0", "<pose>0 0 0.1"),
              HasSubstr("<pose>: needs 6 numbers, is '0 0 0.1'"));
  EXPECT_THAT(error_with("<motorConstant>8e-06", "<motorConstant>8e-06 N"),
              HasSubstr("<motorConstant> must be a number, is '8e-06 N'"));
}

// SDF 1.4 gives axes in the model's frame, 1.5 and 1.6 on request, 1.7 and newer in the joint's.
TEST_F(VehicleFolder, AxesFollowTheVersionOfTheFile) {
  std::string turned = TiltingArms("<lower>-1</lower><upper>1</upper><velocity>3</velocity>");
  turned.replace(turned.find("<pose>0.2 -0.2 0.1 0 0 0"), 24, "<pose>0.2 -0.2 0.1 0 0 1.5707963267948966");
  const auto axis_of = [&](const std::string& version, const std::string& more) {
    std::string text = turned;
    text.replace(text.find("1.6"), 3, version);
    text.replace(text.find("<xyz>0 1 0</xyz>"), 16, "<xyz>0 1 0</xyz>" + more);
    Write("tilt.sdf", text);
    return Load("tilt.sdf").hinges[0].axis_B;
  };
  const std::string in_model = "<use_parent_model_frame>1</use_parent_model_frame>";
  EXPECT_NEAR((axis_of("1.4", "") - Vector3d(0, 1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((axis_of("1.5", in_model) - Vector3d(0, 1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((axis_of("1.6", "") - Vector3d(-1, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((axis_of("1.9", "") - Vector3d(-1, 0, 0)).norm(), 0, 1e-12);
  // Newer than the installed libsdformat.
  EXPECT_NEAR((axis_of("1.11", "") - Vector3d(-1, 0, 0)).norm(), 0, 1e-12);
}

// The layout of PX4's folders: the airframe is a sibling that model.config describes.
TEST_F(VehicleFolder, IncludesAreFoundMergedAndNested) {
  const std::string config =
      "<model><name>b</name><sdf version='1.5'>old.sdf</sdf>"
      "<sdf version='1.9'>new.sdf</sdf></model>";
  Write("frame/model.config", config);
  Write("frame/new.sdf", Sdf("<pose>0 0 0.5 0 0 0</pose>\n" + QuadrotorFrame()));
  Write("frame/old.sdf", "<sdf");
  Write("quad/model.sdf",
        Sdf("<include merge='true'><uri>model://frame</uri></include>\n" + QuadrotorPlugins()));
  const VehicleModel merged = Load("quad/model.sdf");
  EXPECT_EQ(merged.base.link, "base_link");
  // A nested model's names have its name before them.
  Write("nested/model.sdf",
        Sdf("<include><uri>model://frame</uri><name>f</name><pose>1 2 3 0 0 1</pose></include>\n" +
                QuadrotorPlugins("f::"),
            "1.9"));
  const VehicleModel nested = Load("nested/model.sdf");
  EXPECT_EQ(nested.base.link, "f::base_link");
  EXPECT_EQ(nested.rotors[1].name, "f_rotor_1");
  // Both are the frame itself.
  Write("plain.sdf", Sdf(QuadrotorFrame() + QuadrotorPlugins()));
  const VehicleModel plain = Load("plain.sdf");
  for (const VehicleModel* model : {&merged, &nested}) {
    EXPECT_NEAR((model->base.inertia_kg_m2 - plain.base.inertia_kg_m2).norm(), 0, 1e-12);
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_NEAR((model->rotors[i].p_LR_m - plain.rotors[i].p_LR_m).norm(), 0, 1e-12);
  }
}

TEST_F(VehicleFolder, PosesOfIncludesMoveWhatTheyInclude) {
  Write("box/model.sdf", Sdf(Body("box", "0.1 0 0 0 0 0", "1", "0.01 0.01 0.01"), "1.9"));
  for (const char* merge : {"merge='true'", ""}) {
    const bool is_merged = *merge != '\0';
    Write(
        "quad/model.sdf",
        Sdf(QuadrotorFrame() + "<include " + merge +
                "><uri>../box</uri><name>load</name><pose>0 0 -0.5 0 0 1.5707963267948966</pose></include>" +
                JointOf("a", "fixed", "base_link", is_merged ? "box" : "load::box") + QuadrotorPlugins(),
            "1.9"));
    const VehicleModel model = Load("quad/model.sdf");
    // 1 kg at (0, 0.1, -0.6) and 0.02 kg of propellers at z = 0.02, with 1.5 kg at 0.
    EXPECT_NEAR((model.base.p_com_m - Vector3d(0, 0.1, -0.6 + 0.02 * 0.02) / 2.52).norm(), 0, 1e-12) << merge;
  }
}

TEST_F(VehicleFolder, ErrorsOfIncludedFilesHaveTheirPlace) {
  Write("box/model.sdf", Sdf("\n\n<link name='box'><inertial><mass>1</mass></inertial></link>\n"));
  Write("quad/model.sdf", Sdf(QuadrotorFrame() + "<include><uri>../box</uri><name>load</name></include>" +
                              JointOf("a", "fixed", "base_link", "load::box") + QuadrotorPlugins()));
  EXPECT_THAT(Error("quad/model.sdf"),
              HasSubstr((folder_ / "box/model.sdf").string() + ":5: link 'load::box' has no <inertia>"));
  Write("quad/model.sdf", Sdf(QuadrotorFrame() + "<include><uri>model://crate</uri></include>"));
  EXPECT_THAT(Error("quad/model.sdf"), AllOf(HasSubstr("<uri> 'model://crate' is not found"),
                                             HasSubstr((folder_ / "crate").string())));
  Write("quad/model.sdf", Sdf("<include merge='true'><uri>model.sdf</uri></include>"));
  EXPECT_THAT(Error("quad/model.sdf"), HasSubstr("does one include itself?"));
}

TEST_F(VehicleFolder, MistakesOfModelsHaveTheirLine) {
  const auto error = [&](const std::string& text) {
    Write("quad.sdf", text);
    const std::string message = Error("quad.sdf");
    return message.substr(std::min(message.size(), message.find("quad.sdf")));
  };
  EXPECT_THAT(error("<model name='quad'/>"), HasSubstr("quad.sdf:1: not an SDF file: the root is not <sdf>"));
  EXPECT_THAT(error("<sdf version='1.6'/>"), HasSubstr("quad.sdf:1: holds no <model>"));
  EXPECT_THAT(error("<sdf version='1.6'>\n<model name='a'/>\n<model name='b'/></sdf>"),
              HasSubstr("quad.sdf:3: holds a second <model>"));
  EXPECT_THAT(error("<sdf version='1.6'><world name='w'>\n<model name='quad'/></world></sdf>"),
              HasSubstr("The world holds: <model name=\"quad\"> of line 2"));
  EXPECT_THAT(error(Sdf("<include><uri>https://fuel.gazebosim.org/x500</uri></include>")),
              HasSubstr("quad.sdf:3: <uri> 'https://fuel.gazebosim.org/x500': download this model yourself"));
  EXPECT_THAT(error(Sdf("<model name='a' placement_frame='arm'/>")),
              HasSubstr("quad.sdf:3: placement_frame is not supported"));
  EXPECT_THAT(error(Sdf("<model/>")), HasSubstr("quad.sdf:3: a model in a model needs a name"));
  EXPECT_THAT(error(Sdf("<static>true</static>" + QuadrotorFrame() + QuadrotorPlugins())),
              HasSubstr("quad.sdf:2: a <static> model cannot fly"));
  const std::string nameless = error(Sdf(QuadrotorFrame() + "<link/>\n<joint name='held' type='fixed'>" +
                                         "<child>world</child></joint>" + QuadrotorPlugins()));
  EXPECT_THAT(nameless, HasSubstr("quad.sdf:12: <link> has no name"));
  EXPECT_THAT(nameless, HasSubstr("quad.sdf:13: joint 'held' has no <parent>"));
  EXPECT_THAT(nameless, HasSubstr("quad.sdf:13: joint 'held' holds the vehicle on the world: remove it"));
}

TEST_F(VehicleFolder, ModelsAreFoundInTheFoldersOfTheEnvironment) {
  Write("here/frame/model.sdf", Sdf(QuadrotorFrame()));
  Write("there/quad.sdf",
        Sdf("<include merge='true'><uri>model://frame</uri></include>" + QuadrotorPlugins()));
  EXPECT_THAT(Error("there/quad.sdf"), HasSubstr("is not found"));
  ASSERT_EQ(setenv("GZ_SIM_RESOURCE_PATH", (":/nowhere:" + (folder_ / "here").string()).c_str(), 1), 0);
  EXPECT_EQ(Load("there/quad.sdf").rotors.size(), 4U);
  unsetenv("GZ_SIM_RESOURCE_PATH");
}

// A model that is written into another, and a link that stands on a frame.
TEST_F(VehicleFolder, NestedModelsAndFramesAreFlattened) {
  std::string frame = QuadrotorFrame();
  const std::string pose = "<link name='rotor_0'><pose>0.2 -0.2 0.12 0 0 0</pose>";
  frame.replace(frame.find(pose), pose.size(),
                "<link name='rotor_0'><pose relative_to='arm'>0.1 0 0 0 0 0</pose>");
  frame += "<frame name='arm' attached_to='base_link'><pose>0.1 -0.2 0.02 0 0 0</pose></frame>";
  Write("quad.sdf", Sdf("<model name='f'>" + frame + "</model>" + QuadrotorPlugins("f::"), "1.9"));
  const VehicleModel model = Load("quad.sdf");
  EXPECT_EQ(model.base.link, "f::base_link");
  EXPECT_NEAR((model.rotors[0].p_LR_m - Vector3d(0.2, -0.2, 0.02)).norm(), 0, 1e-12);
}

// ProVANT's plugins state neither the direction nor the limit of a thrust.
TEST_F(VehicleFolder, ProvantPluginsNameTheLinksThatTheyPush) {
  Write("two.sdf", Sdf(QuadrotorFrame() +
                       "<plugin name='thrust' filename='libgazebo_ros_brushless_plugin.so'><LinkDir>rotor_0"
                       "</LinkDir><LinkEsq>rotor_2</LinkEsq><DragCte>0.017</DragCte></plugin>"));
  EXPECT_THAT(Error("two.sdf"),
              AllOf(HasSubstr("rotor 'right': the plugin does not state direction and force_max_n"),
                    HasSubstr("rotor 'left': the plugin does not state direction and force_max_n")));
  EXPECT_THAT(VehicleMapping(folder_ / "two.sdf"), HasSubstr("drag_ratio_m=\"0.017\""));
  Write("four.sdf",
        Sdf(QuadrotorFrame() +
            "<plugin name='thrust' filename='libgazebo_ros_QuadForces.so'><Motor1>rotor_0</Motor1>"
            "<Motor2>rotor_1</Motor2><Motor3>rotor_2</Motor3><Motor4>rotor_3</Motor4></plugin>"));
  EXPECT_THAT(
      Error("four.sdf"),
      HasSubstr("rotor 'rotor_3': the plugin does not state direction, drag_ratio_m and force_max_n"));
}

TEST_F(VehicleFolder, AReversibleMotorPushesBothWays) {
  std::string text = Sdf(QuadrotorFrame() + QuadrotorPlugins());
  text.replace(text.find("<motorNumber>0</motorNumber>"), 28, "<reversible>true</reversible>");
  Write("quad.sdf", text);
  EXPECT_DOUBLE_EQ(Load("quad.sdf").rotors[0].force_min_n, -8);
  text.replace(text.find("<turningDirection>ccw"), 21, "<turningDirection>up");
  Write("quad.sdf", text);
  EXPECT_THAT(Error("quad.sdf"), HasSubstr("rotor 'rotor_0': the plugin does not state direction"));
}

TEST_F(VehicleFolder, OtherFormatsAreRefusedWithTheCommandThatConvertsThem) {
  Write("arm.urdf", "<robot name='arm'/>");
  EXPECT_THAT(Error("arm.urdf"), AllOf(HasSubstr("URDF"), HasSubstr("`gz sdf -p "), HasSubstr("> arm.sdf`"),
                                       HasSubstr("ignition-tools")));
  Write("arm.xacro", "<robot xmlns:xacro='http://ros.org/wiki/xacro' name='arm'/>");
  EXPECT_THAT(Error("arm.xacro"),
              AllOf(HasSubstr("`xacro "), HasSubstr("&& gz sdf -p arm.urdf > arm.sdf`"), HasSubstr("PyPI")));
  Write("iris.sdf.jinja", "<sdf version='1.6'>\n{% set mass = 1 %}<model name='iris'/></sdf>");
  EXPECT_THAT(Error("iris.sdf.jinja"),
              AllOf(HasSubstr("iris.sdf.jinja:2: a jinja template"), HasSubstr("jinja_gen.py"),
                    HasSubstr("--output-file iris.sdf`"), HasSubstr("python3-jinja2")));
  Write("world.sdf",
        "<sdf version='1.6'><world name='w'><include><uri>model://x500</uri></include></world></sdf>");
  EXPECT_THAT(Error("world.sdf"), AllOf(HasSubstr("a world"), HasSubstr("name the vehicle's own file"),
                                        HasSubstr("model://x500")));
}

// The blades' lift in still air, by hand: 2 * 0.5 * 1.2 kg/m^3 * 0.002 m^2 * (4 * 0.3) * (800/s * 0.1 m)^2.
TEST_F(VehicleFolder, ArduPilotPropellersAreTheirBlades) {
  std::string plugins = "<plugin name='ArduPilotPlugin' filename='ArduPilotPlugin'>";
  for (int i = 0; i < 4; ++i)
    plugins += "<control channel='" + std::to_string(i) + "'><jointName>rotor_" + std::to_string(i) +
               "_joint</jointName><type>VELOCITY</type><multiplier>" + (i < 2 ? "800" : "-800") +
               "</multiplier></control>";
  plugins += "</plugin>";
  for (int i = 0; i < 8; ++i)
    plugins +=
        "<plugin name='gz::sim::systems::LiftDrag' filename='gz-sim-lift-drag-system'><a0>0.3</a0>"
        "<cla>4</cla><cda>0.1</cda><area>0.002</area><air_density>1.2</air_density><cp>" +
        std::string(i % 2 == 0 ? "0.1" : "-0.1") + " 0 0</cp><link_name>rotor_" + std::to_string(i / 2) +
        "</link_name></plugin>";
  Write("quad.sdf", Sdf(QuadrotorFrame() + plugins));
  const VehicleModel model = Load("quad.sdf");
  EXPECT_NEAR(model.rotors[0].force_max_n, 2 * 0.5 * 1.2 * 0.002 * 1.2 * 6400, 1e-9);
  // Drag 0.1 * 0.3 at 0.1 m for each lift of 4 * 0.3.
  EXPECT_NEAR(model.rotors[0].drag_ratio_m, 0.1 * 0.1 / 4, 1e-12);
  EXPECT_EQ(model.rotors[0].direction, -1);
  EXPECT_EQ(model.rotors[3].direction, 1);
  for (const std::string& warning : warnings_) EXPECT_THAT(warning, Not(HasSubstr("LiftDrag")));
}

TEST_F(VehicleFolder, ElementsOfRotorsAndServosAreRead) {
  const std::string head = QuadrotorFrame() +
                           "<tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'>"
                           "<tiltproof:base link='base_link'/>";
  std::string rotors;
  for (int i = 0; i < 4; ++i)
    rotors += "<tiltproof:rotor link='rotor_" + std::to_string(i) + "' direction='" + (i < 2 ? "1" : "-1") +
              "' drag_ratio_m='0.01' force_max_n='9' time_constant_s='0.05'/>";
  Write("quad.sdf", Sdf(head + rotors + "</tiltproof:vehicle>"));
  const VehicleModel model = Load("quad.sdf");
  EXPECT_EQ(model.rotors[2].time_constant_up_s, 0.05);
  EXPECT_EQ(model.rotors[2].time_constant_down_s, 0.05);
  const auto error_with = [&](const std::string& servo) {
    Write("quad.sdf", Sdf(head + rotors + servo + "</tiltproof:vehicle>"));
    return Error("quad.sdf");
  };
  EXPECT_THAT(error_with("<tiltproof:servo joint='rotor_0_joint' mode='position'/>"),
              HasSubstr("give speed_max_rad_s here or <velocity> there"));
  EXPECT_THAT(error_with("<tiltproof:servo joint='rotor_0_joint' mode='angle'/>"),
              HasSubstr("'mode' must be position or torque, is 'angle'"));
  EXPECT_THAT(error_with("<tiltproof:servo joint='rotor_0_joint' torque_max_nm='1' speed_max_rad_s='1'/>"),
              HasSubstr("'speed_max_rad_s' needs mode=\"position\""));
}

}  // namespace
}  // namespace tiltproof::plant
