// SDF files of vehicles with other rotors than two that tilt.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "plant/plant.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string LinkXml(const std::string& name, const std::string& pose, double mass_kg, double moment_kg_m2) {
  const std::string moment = std::to_string(moment_kg_m2);
  return "<link name='" + name + "'><pose>" + pose + "</pose><inertial><mass>" + std::to_string(mass_kg) +
         "</mass><inertia><ixx>" + moment + "</ixx><iyy>" + moment + "</iyy><izz>" + moment +
         "</izz></inertia></inertial>" +
         (name == "body" ? "<collision name='c'><geometry><box><size>0.3 0.3 0.1</size></box></geometry>"
                           "</collision>"
                         : "") +
         "</link>\n";
}
std::string FixedXml(const std::string& parent, const std::string& child) {
  return "<joint name='" + parent + "_" + child + "' type='fixed'><parent>" + parent + "</parent><child>" +
         child + "</child></joint>\n";
}
std::string ThrusterXml(const std::string& link, int direction, const std::string& more = "") {
  return "<tiltproof:thruster link='" + link + "' direction='" + std::to_string(direction) +
         "' drag_ratio_m='0.016' force_max_n='10' " + more + "/>\n";
}
std::string HingeXml(const std::string& child) {
  return "<joint name='tilt' type='revolute'><parent>body</parent><child>" + child +
         "</child><axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>\n";
}

class VehicleFile : public ::testing::Test {
 protected:
  VehicleFile() { std::filesystem::create_directories(folder_); }
  ~VehicleFile() override { std::filesystem::remove_all(folder_); }

  VehicleModel Load(const std::string& bodies, const std::string& elements) {
    const std::filesystem::path file = folder_ / "vehicle.sdf";
    std::ofstream(file) << "<sdf version='1.9'><model name='vehicle'>" << bodies
                        << "<tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'>"
                           "<tiltproof:base link='body'/>"
                        << elements << "</tiltproof:vehicle></model></sdf>";
    return LoadVehicle(file, {}, warnings_);
  }
  std::string Error(const std::string& bodies, const std::string& elements) {
    try {
      Load(bodies, elements);
      ADD_FAILURE() << "loaded";
      return {};
    } catch (const VehicleError& error) {
      return error.what();
    }
  }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                  ("tiltproof-rotors-" + std::to_string(::getpid()) + "-" +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  std::vector<std::string> warnings_;
};

TEST_F(VehicleFile, AFallingThrustMayHaveALagOfItsOwn) {
  const std::string bodies =
      LinkXml("body", "0 0 0 0 0 0", 1, 0.01) + LinkXml("right", "0 -0.3 0 0 0 0", 0.1, 1e-4) +
      LinkXml("left", "0 0.3 0 0 0 0", 0.1, 1e-4) + FixedXml("body", "right") + FixedXml("body", "left");
  const VehicleModel model =
      Load(bodies, ThrusterXml("right", 1, "time_constant_s='0.0125' time_constant_down_s='0.025'") +
                       ThrusterXml("left", -1, "time_constant_s='0.02'"));
  EXPECT_EQ(model.rotors[0].time_constant_up_s, 0.0125);
  EXPECT_EQ(model.rotors[0].time_constant_down_s, 0.025);
  EXPECT_EQ(model.rotors[1].time_constant_down_s, 0.02);
  EXPECT_THAT(Error(bodies, ThrusterXml("right", 1, "time_constant_down_s='-1'") + ThrusterXml("left", -1)),
              HasSubstr("'time_constant_down_s' must be in [0, 10], is -1"));
}

std::string QuadrotorBodies() {
  return LinkXml("body", "0 0 0 0 0 0", 1, 0.01) +
         // Turned about z, which changes nothing but the axes of the link.
         LinkXml("front_left", "0.2 0.2 0.05 0 0 1", 0.05, 0.0001) +
         LinkXml("front_right", "0.2 -0.2 0.05 0 0 0", 0.05, 0.0001) +
         LinkXml("rear_left", "-0.2 0.2 0.05 0 0 0", 0.05, 0.0001) +
         LinkXml("rear_right", "-0.2 -0.2 0.05 0 0 0", 0.05, 0.0001) + FixedXml("body", "front_left") +
         FixedXml("body", "front_right") + FixedXml("body", "rear_left") + FixedXml("body", "rear_right");
}
std::string QuadrotorElements() {
  return ThrusterXml("front_left", 1) + ThrusterXml("front_right", -1) + ThrusterXml("rear_left", -1) +
         ThrusterXml("rear_right", 1, "name='back'");
}

TEST_F(VehicleFile, RotorsFixedToTheBaseBecomeAPartOfIt) {
  const VehicleModel model = Load(QuadrotorBodies(), QuadrotorElements());
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_TRUE(model.hinges.empty());
  ASSERT_EQ(model.rotors.size(), 4U);
  // Without a name a rotor has its link's.
  EXPECT_EQ(model.rotors[0].name, "front_left");
  EXPECT_EQ(model.rotors[3].name, "back");
  EXPECT_FALSE(model.rotors[0].hinge);
  EXPECT_NEAR((model.rotors[0].p_LR_m - Vector3d(0.2, 0.2, 0.05)).norm(), 0, 1e-15);
  EXPECT_EQ(model.signals().inputs[3].name, "f_back_n");
  EXPECT_DOUBLE_EQ(model.MassTotal(), 1.2);
  // 0.2 kg at a height of 0.05 m, with 1 kg at 0.
  EXPECT_NEAR((model.base.p_com_m - Vector3d(0, 0, 0.01 / 1.2)).norm(), 0, 1e-15);
  const double reduced_kg = 1 * 0.2 / 1.2;
  EXPECT_NEAR(model.base.inertia_kg_m2(0, 0), 0.01 + 4 * 0.0001 + 0.2 * 0.2 * 0.2 + reduced_kg * 0.05 * 0.05,
              1e-12);
  EXPECT_NEAR(model.base.inertia_kg_m2(2, 2), 0.01 + 4 * 0.0001 + 0.2 * (0.2 * 0.2 + 0.2 * 0.2), 1e-12);
  EXPECT_NEAR(model.base.inertia_kg_m2(0, 1), 0, 1e-12);
  for (const double force_n : model.HoverInput()) EXPECT_NEAR(force_n, 1.2 * 9.81 / 4, 1e-10);
  Plant plant(model, {});
  for (int i = 0; i < 250; ++i) plant.Step(model.HoverInput());
  std::vector<double> state(12);
  plant.State(state);
  EXPECT_NEAR(state[2], 1, 1e-9);
}

TEST_F(VehicleFile, AHingeCarriesTwoRotors) {
  // The thrusts push along the links' y axes, which point up.
  const VehicleModel model =
      Load(LinkXml("body", "0 0 0 0 0 0", 1, 0.01) + LinkXml("boom", "0 0 0.1 0 0 0", 0.1, 0.001) +
               LinkXml("r1", "0 -0.3 0.15 1.5707963267948966 0 0", 0.05, 0.0001) +
               LinkXml("r2", "0 0.3 0.15 1.5707963267948966 0 0", 0.05, 0.0001) + HingeXml("boom") +
               FixedXml("boom", "r1") + FixedXml("boom", "r2"),
           ThrusterXml("r1", 1, "axis='0 1 0'") + ThrusterXml("r2", -1, "axis='0 1 0'") +
               "<tiltproof:servo joint='tilt' torque_max_nm='2'/>");
  ASSERT_EQ(model.hinges.size(), 1U);
  // Two rotors: the hinge has the name of its joint.
  EXPECT_EQ(model.hinges[0].name, "tilt");
  EXPECT_EQ(model.signals().states[6].name, "alpha_tilt_rad");
  EXPECT_EQ(model.rotors[1].hinge, 0U);
  EXPECT_NEAR((model.rotors[1].p_LR_m - Vector3d(0, 0.3, 0.05)).norm(), 0, 1e-15);
  EXPECT_NEAR((model.rotors[1].thrust_axis_L - Vector3d::UnitZ()).norm(), 0, 1e-15);
  EXPECT_DOUBLE_EQ(model.hinges[0].body.mass_kg, 0.2);
  EXPECT_NEAR((model.hinges[0].body.p_com_m - Vector3d(0, 0, 0.025)).norm(), 0, 1e-15);
  EXPECT_NEAR(model.HoverInput()[0], 1.2 * 9.81 / 2, 1e-9);
  EXPECT_NEAR(model.HoverInput()[2], 0, 1e-9);
}

TEST_F(VehicleFile, ShapesOfEveryLinkKeepTheirPlace) {
  const auto with_shape = [](std::string link, const std::string& pose, const std::string& geometry) {
    return link.insert(link.rfind("</link>"), "<collision name='shape'><pose>" + pose + "</pose><geometry>" +
                                                  geometry + "</geometry></collision>");
  };
  const std::string upright = "1.5707963267948966 0 0";
  const VehicleModel model =
      Load(with_shape(LinkXml("boom", "0 0 0.1 0 0 0", 0.1, 0.001), "0.02 0 0 0 0 0",
                      "<sphere><radius>0.07</radius></sphere>") +
               LinkXml("body", "0 0 0 0 0 0", 1, 0.01) +
               with_shape(LinkXml("r1", "0 -0.3 0.15 " + upright, 0.05, 0.0001), "0 0 0.1 0 0 0",
                          "<cylinder><radius>0.1</radius><length>0.02</length></cylinder>") +
               with_shape(LinkXml("r2", "0 0.3 0.15 " + upright, 0.05, 0.0001), "0 0 0 0 0 0",
                          "<mesh><uri>r2.stl</uri></mesh>") +
               HingeXml("boom") + FixedXml("boom", "r1") + FixedXml("boom", "r2"),
           ThrusterXml("r1", 1, "axis='0 1 0'") + ThrusterXml("r2", -1, "axis='0 1 0'") +
               "<tiltproof:servo joint='tilt' torque_max_nm='2'/>");
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("meshes are not supported, ignored: r2.stl")));
  ASSERT_EQ(model.shapes.size(), 3U);
  EXPECT_EQ(model.shapes[0].link, "body");  // first, wherever it stands
  EXPECT_FALSE(model.shapes[0].hinge);
  EXPECT_EQ(model.shapes[1].link, "boom");
  EXPECT_EQ(model.shapes[1].hinge, 0U);
  EXPECT_NEAR((model.shapes[1].p_LS_m - Vector3d(0.02, 0, 0)).norm(), 0, 1e-15);
  // 0.05 m above the boom's frame; its z points along the boom's -y.
  EXPECT_EQ(model.shapes[2].link, "r1");
  EXPECT_EQ(model.shapes[2].hinge, 0U);
  EXPECT_EQ(model.shapes[2].kind, CollisionShape::Kind::kCylinder);
  EXPECT_NEAR((model.shapes[2].p_LS_m - Vector3d(0, -0.4, 0.05)).norm(), 0, 1e-15);
  EXPECT_NEAR((model.shapes[2].R_LS * Vector3d::UnitZ() + Vector3d::UnitY()).norm(), 0, 1e-15);
}

TEST_F(VehicleFile, ARotorOnAHingeAndOthersOnTheBase) {
  const VehicleModel model =
      Load(LinkXml("body", "0 0 0 0 0 0", 1, 0.01) + LinkXml("tail", "-0.3 0 0 0 0 0", 0.1, 0.0001) +
               LinkXml("left", "0.15 0.2 0 0 0 0", 0.1, 0.0001) +
               LinkXml("right", "0.15 -0.2 0 0 0 0", 0.1, 0.0001) +
               "<joint name='yaw' type='revolute'><parent>body</parent><child>tail</child><axis>"
               "<xyz>1 0 0</xyz><limit><lower>-1</lower><upper>1</upper><effort>1</effort></limit></axis>"
               "</joint>" +
               FixedXml("body", "left") + FixedXml("body", "right"),
           ThrusterXml("left", 1, "name='left'") + ThrusterXml("right", -1, "name='right'") +
               ThrusterXml("tail", 1, "name='tail'") + "<tiltproof:servo joint='yaw'/>");
  EXPECT_EQ(model.hinges[0].name, "tail");
  EXPECT_EQ(model.rotors[2].hinge, 0U);
  EXPECT_EQ(model.signals().inputs[0].name, "f_l_n");
  EXPECT_EQ(model.signals().inputs[3].name, "tau_tail_nm");
}

TEST_F(VehicleFile, MistakesAreNamed) {
  const std::string bodies = QuadrotorBodies(), elements = QuadrotorElements();
  EXPECT_THAT(Error(bodies, ""),
              HasSubstr("a vehicle has 1 to 8 <tiltproof:rotor>, or motor plugins; found 0"));
  EXPECT_THAT(Error(bodies, elements + elements + elements),
              HasSubstr("1 to 8 <tiltproof:rotor>, or motor plugins; found 12"));
  EXPECT_THAT(Error(bodies, elements + ThrusterXml("rear_right", 1, "name='other'")),
              HasSubstr("two rotors have link 'rear_right'"));
  EXPECT_THAT(Error(bodies, ThrusterXml("front_left", 1, "name='back'") + ThrusterXml("front_right", -1) +
                                ThrusterXml("rear_left", -1) + ThrusterXml("rear_right", 1, "name='back'")),
              HasSubstr("two rotors have the name 'back'"));
  EXPECT_THAT(Error(bodies, ThrusterXml("front_left", 1, "name='r'") + ThrusterXml("front_right", -1) +
                                ThrusterXml("rear_left", -1) + ThrusterXml("rear_right", 1, "name='right'")),
              HasSubstr("two rotors or hinges have the signal 'f_r_n': rename one of them"));
  EXPECT_THAT(Error(bodies, ThrusterXml("front_left", 1, "name='1st'") + ThrusterXml("front_right", -1) +
                                ThrusterXml("rear_left", -1) + ThrusterXml("rear_right", 1)),
              HasSubstr("name: '1st' must be letters, digits and '_'"));
  EXPECT_THAT(Error(bodies, elements + "<tiltproof:servo joint='body_rear_left' torque_max_nm='2'/>"),
              HasSubstr("servo joint 'body_rear_left' is fixed"));
  const auto at = bodies.find("<joint name='body_rear_left'");
  const std::string loose =
      bodies.substr(0, at) + bodies.substr(bodies.find("<joint name='body_rear_right'"));
  EXPECT_THAT(Error(loose, elements),
              HasSubstr("link 'rear_left' must be the child of one joint, is that of 0"));
  // Two links that hang on each other.
  EXPECT_THAT(Error(loose + FixedXml("rear_left", "rear_left"), elements),
              HasSubstr("link 'rear_left' does not hang on the base 'body': its joints are a circle"));
  // The element that it lacks is offered.
  EXPECT_THAT(Error(loose + HingeXml("rear_left"), elements),
              AllOf(HasSubstr("no servo's joint has rotor link 'rear_left' as its child"),
                    HasSubstr("<tiltproof:servo joint=\"tilt\" torque_max_nm=\"2\"/>")));
}

TEST_F(VehicleFile, MissingThrustersAreOfferedForEachJoint) {
  const std::string error = Error(QuadrotorBodies(), ThrusterXml("front_left", 1));
  for (const char* link : {"front_right", "rear_left", "rear_right"})
    EXPECT_THAT(error,
                HasSubstr("<tiltproof:rotor name=\"" + std::string(link) + "\" link=\"" + link + "\""));
  EXPECT_THAT(error, ::testing::Not(HasSubstr("tiltproof:servo joint")));
}

TEST_F(VehicleFile, WeakRotorsCannotHover) {
  EXPECT_THAT(Error(LinkXml("body", "0 0 0 0 0 0", 5, 0.05) +
                        QuadrotorBodies().substr(QuadrotorBodies().find("\n") + 1),
                    QuadrotorElements()),
              HasSubstr("the vehicle cannot hover: its front_left rotor has to give 12.75 N"));
}

}  // namespace
}  // namespace tiltproof::plant
