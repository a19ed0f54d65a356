// Reading vehicles: the shipped ones, the authors' own file, and files with every mistake we could think of.
#include "plant/vehicle_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <regex>
#include <sstream>

#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kBeta_rad = 5 * 3.14159265358979323846 / 180;

TEST(VehicleModel, ReadsTheDesignPlant) {
  const VehicleModel model = LoadShipped("tiltrotor");
  EXPECT_EQ(model.name, "tiltrotor");
  EXPECT_EQ(model.base.link, "body");
  EXPECT_DOUBLE_EQ(model.MassTotal(), 1.92509767079622 + 0.0809439719362664 + 0.080943968597);
  EXPECT_DOUBLE_EQ(model.base.inertia_kg_m2(0, 2), 0.000362780890165671);
  EXPECT_DOUBLE_EQ(model.base.p_com_m.z(), -0.01819008141);

  ASSERT_EQ(model.hinges.size(), 2U);
  ASSERT_EQ(model.rotors.size(), 2U);
  const Hinge &right = model.hinges[0], &left = model.hinges[1];
  EXPECT_EQ(right.joint, "hinge_right");
  EXPECT_EQ(left.joint, "hinge_left");
  EXPECT_NEAR((right.p_BH_m - Eigen::Vector3d(0.00002, -0.27761, 0.05621)).norm(), 0, 1e-15);
  EXPECT_NEAR((left.p_BH_m - Eigen::Vector3d(0.00002, 0.27761, 0.05621)).norm(), 0, 1e-15);
  // The hinges tilt with the thrusters: R_x(-/+beta) e_y.
  EXPECT_NEAR((right.axis_B - Eigen::Vector3d(0, std::cos(kBeta_rad), -std::sin(kBeta_rad))).norm(), 0,
              1e-12);
  EXPECT_NEAR((left.axis_B - Eigen::Vector3d(0, std::cos(kBeta_rad), std::sin(kBeta_rad))).norm(), 0, 1e-12);
  EXPECT_EQ(model.rotors[0].direction, 1);
  EXPECT_EQ(model.rotors[1].direction, -1);
  EXPECT_EQ(model.rotors[0].hinge, 0U);
  EXPECT_EQ(model.rotors[1].hinge, 1U);
  EXPECT_EQ(right.angle_min_rad, -1.5);
  EXPECT_EQ(right.angle_max_rad, 1.5);
  EXPECT_NEAR(model.rotors[0].drag_ratio_m, 1.7e-7 / 9.5e-6, 1e-10);

  EXPECT_EQ(model.InputMin(), (std::vector<double>{0, 0, -2, -2}));
  EXPECT_EQ(model.InputMax(), (std::vector<double>{30, 30, 2, 2}));
  EXPECT_NEAR(model.HoverInput().at(0), 10.27118, 1e-5);
  EXPECT_NEAR(model.HoverInput().at(1), 10.28035, 1e-5);
}

// In the order of the columns of trace.csv.
TEST(VehicleModel, GivesItsSignals) {
  const VehicleSignals signals = LoadShipped("tiltrotor").signals();
  const auto names = [](const SignalTable& table) {
    std::string all;
    for (const Signal& signal : table) all += signal.name + " ";
    return all;
  };
  EXPECT_EQ(names(signals.states),
            "x_m y_m z_m roll_rad pitch_rad yaw_rad alpha_r_rad alpha_l_rad vx_m_s vy_m_s vz_m_s "
            "wx_rad_s wy_rad_s wz_rad_s alpha_r_rad_s alpha_l_rad_s ");
  EXPECT_EQ(names(signals.inputs), "f_r_n f_l_n tau_r_nm tau_l_nm ");
  EXPECT_EQ(signals.sensors, signals.states);
  EXPECT_EQ(signals.states[6], (Signal{"alpha_r_rad", "rad", 0.5, SignalFrame::kHinge}));
  EXPECT_EQ(signals.states[9], (Signal{"vy_m_s", "m/s", 1.0, SignalFrame::kWorld}));
  EXPECT_EQ(signals.inputs[1], (Signal{"f_l_n", "N", 1.0, SignalFrame::kRotor, 0.0, 30.0}));
  EXPECT_EQ(signals.inputs[2], (Signal{"tau_r_nm", "N m", 1.0, SignalFrame::kHinge, -2.0, 2.0}));
}

TEST(VehicleModel, ReadsTheAsPublishedPlant) {
  const VehicleModel model = LoadShipped("tiltrotor_published");
  for (const Hinge& hinge : model.hinges) {
    EXPECT_NEAR((hinge.axis_B - Eigen::Vector3d::UnitY()).norm(), 0, 1e-12);
    EXPECT_NEAR(hinge.body.p_com_m.z(), 0.05948, 1e-5);
  }
  EXPECT_DOUBLE_EQ(model.hinges[0].body.inertia_kg_m2(0, 0), 3.88267747087835e-05);
}

TEST(VehicleModel, RefusesTheAuthorsFileForItsInertiaAndSaysWhere) {
  std::vector<std::string> warnings;
  const auto file = SourceFile("tests/golden/vant_2.sdf");
  try {
    LoadVehicle(file, {}, warnings);
    FAIL() << "loaded";
  } catch (const VehicleError& error) {
    ASSERT_EQ(error.problems().size(), 1U);
    const VehicleProblem& problem = error.problems()[0];
    EXPECT_EQ(problem.file, file);
    EXPECT_EQ(problem.line, 14);
    EXPECT_THAT(problem.message, AllOf(HasSubstr("'servodir'"), HasSubstr("triangle inequality"),
                                       HasSubstr("--allow-invalid-inertia")));
    EXPECT_EQ(error.what(), file.string() + ":14: " + problem.message);
  }
}

TEST(VehicleModel, ReadsTheAuthorsFileWithTheMappingBesideItWhenAskedTo) {
  std::vector<std::string> warnings;
  ::testing::internal::CaptureStderr();
  const VehicleModel model = LoadVehicle(SourceFile("tests/golden/vant_2.sdf"),
                                         {.allow_invalid_inertia = true, .mapping = {}}, warnings);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(model.name, "modelo");
  EXPECT_EQ(model.base.link, "corpo");
  EXPECT_EQ(model.hinges[0].body.link, "servodir");
  EXPECT_EQ(model.hinges[1].joint, "aL");
  // SDF 1.4: a joint's axis is given in the model's frame.
  EXPECT_NEAR((model.hinges[0].axis_B - Eigen::Vector3d::UnitY()).norm(), 0, 1e-12);
  EXPECT_EQ(model.InputMax(), (std::vector<double>{30, 30, 2, 2}));  // torque: the joints' <effort>

  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("vant_2.sdf:14:"), HasSubstr("triangle inequality"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr(":26:"), HasSubstr("servodir.STL"))));
  ASSERT_EQ(model.sensors.size(), 2U);
  EXPECT_EQ(model.sensors[0].name, "imu_sensor");
  EXPECT_EQ(model.sensors[0].rate_hz, 250);
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr(":113:"), HasSubstr("imu_plugin"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr(":167:"), HasSubstr("empuxo"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr(":141:"), HasSubstr("0.5"), HasSubstr("'aR'"))));
  EXPECT_THAT(warnings,
              Contains(AllOf(HasSubstr("\"corpo\""), HasSubstr("no link has a usable collision shape"))));
  // The box that stands in for the mesh: 12 cm by 63 cm by 19 cm.
  Eigen::Vector3d size = model.shapes.at(0).size_m;
  std::sort(size.data(), size.data() + 3);
  EXPECT_NEAR((size - Eigen::Vector3d(0.119, 0.188, 0.632)).norm(), 0, 2e-3);
}

TEST(InertiaFault, NamesTheReason) {
  const auto diagonal = [](double x, double y, double z) -> Eigen::Matrix3d {
    return Eigen::Vector3d(x, y, z).asDiagonal();
  };
  EXPECT_EQ(InertiaFault(diagonal(1, 2, 3)), "");  // a flat plate: the border
  EXPECT_THAT(InertiaFault(diagonal(1, 2, 3.1)), HasSubstr("triangle inequality"));
  EXPECT_THAT(InertiaFault(diagonal(-1, 2, 2)), HasSubstr("not positive definite"));
  EXPECT_THAT(InertiaFault(diagonal(0, 0, 0)), HasSubstr("not positive definite"));
  EXPECT_THAT(InertiaFault(diagonal(NAN, 1, 1)), HasSubstr("not finite"));
  Eigen::Matrix3d coupled = diagonal(1, 1, 1);
  coupled(0, 1) = coupled(1, 0) = 1.5;
  EXPECT_THAT(InertiaFault(coupled), HasSubstr("not positive definite"));
}

// Each test writes the design plant with one change.
class ChangedVehicle : public ::testing::Test {
 protected:
  ChangedVehicle() {
    std::ifstream in(SourceFile("plant/models/tiltrotor.sdf"));
    std::ostringstream text;
    text << in.rdbuf();
    text_ = text.str();
    folder_ = std::filesystem::temp_directory_path() /
              ("tiltproof-vehicle-" + std::to_string(::getpid()) + "-" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    file_ = folder_ / "vehicle.sdf";
  }
  ~ChangedVehicle() override { std::filesystem::remove_all(folder_); }

  void Replace(const std::string& from, const std::string& to) {
    const std::size_t at = text_.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text_.replace(at, from.size(), to);
    changed_line_ = 1 + static_cast<int>(
                            std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
  }
  VehicleModel Load(const LoadOptions& options = {}) {
    std::ofstream(file_) << text_;
    return LoadVehicle(file_, options, warnings_);
  }
  // The error's messages; fails when there is none, when one has no file, or when anything is printed.
  std::string Error(const LoadOptions& options = {}) {
    ::testing::internal::CaptureStderr();
    std::string message;
    try {
      Load(options);
      ADD_FAILURE() << "loaded";
    } catch (const VehicleError& error) {
      line_ = error.problems().front().line;
      for (const VehicleProblem& problem : error.problems()) {
        EXPECT_FALSE(problem.file.empty());
        message += problem.message + "\n";
      }
      what_ = error.what();
    }
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
    return message;
  }

  std::string text_;
  std::filesystem::path folder_, file_;
  std::vector<std::string> warnings_;
  std::string what_;
  int line_ = -1, changed_line_ = -1;
};

TEST_F(ChangedVehicle, UnchangedIsTheDesignPlant) {
  EXPECT_EQ(Load().HoverInput(), LoadShipped("tiltrotor").HoverInput());
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(ChangedVehicle, MissingFile) {
  EXPECT_THROW(LoadVehicle(folder_ / "none.sdf", {}, warnings_), VehicleError);
  EXPECT_THROW(LoadVehicle(folder_, {}, warnings_), VehicleError);
  // A name that libsdformat could find among its own files.
  EXPECT_THROW(LoadVehicle("model.sdf", {}, warnings_), VehicleError);
}

TEST_F(ChangedVehicle, BrokenXmlNamesTheLine) {
  Replace("</joint>", "</jiont>");
  EXPECT_THAT(Error(), HasSubstr("not well-formed XML"));
  EXPECT_GT(line_, 0);
}

TEST_F(ChangedVehicle, NotAnSdfFile) {
  text_ = "<robot/>";
  EXPECT_THAT(Error(), HasSubstr("not <sdf>"));
  text_ = "<sdf version='1.9'><world name='w'/></sdf>";
  EXPECT_THAT(Error(), HasSubstr("no <model>"));
  text_ = "";
  EXPECT_THAT(Error(), HasSubstr("not well-formed XML"));
}

TEST_F(ChangedVehicle, NumberThatIsNone) {
  Replace("<mass>1.92509767079622</mass>", "<mass>heavy</mass>");
  EXPECT_THAT(Error(), HasSubstr("mass"));
  EXPECT_EQ(line_, changed_line_);
}

TEST_F(ChangedVehicle, MassThatIsNotPositive) {
  Replace("<mass>0.080943968597</mass>", "<mass>-0.1</mass>");
  EXPECT_THAT(Error({.allow_invalid_inertia = true, .mapping = {}}),
              AllOf(HasSubstr("'thruster_left'"), HasSubstr("mass")));
  EXPECT_EQ(line_, changed_line_);
}

// SDF has defaults of 1 kg and 1 kg m^2: such a vehicle flies, but does not exist.
TEST_F(ChangedVehicle, WhatSdfWouldInventIsRefused) {
  Replace("<mass>0.080943968597</mass>", "");
  Replace("<iyy>0.00792827006001647</iyy>", "");
  EXPECT_THAT(Error(), AllOf(HasSubstr("'body' has no <iyy>: SDF puts 1 kg m^2 in its place"),
                             HasSubstr("'thruster_left' has no <mass>: SDF puts 1 kg in its place")));
  text_ = std::regex_replace(text_, std::regex("<inertia>[^]*?</inertia>"), "");
  EXPECT_THAT(Error(), HasSubstr("'body' has no <inertia>: SDF puts 1 kg m^2 in its place"));
  text_ = std::regex_replace(text_, std::regex("<inertial>[^]*?</inertial>"), "");
  EXPECT_THAT(Error(), HasSubstr("'body' has no <inertial>: SDF puts 1 kg and 1 kg m^2 in its place"));
}

TEST_F(ChangedVehicle, OneThatCannotHoverIsRefused) {
  Replace("<mass>1.92509767079622</mass>", "<mass>19.25</mass>");
  // (19.25 + 2 * 0.0809) kg * 9.81 m/s^2 = 190.4 N, of two rotors.
  EXPECT_THAT(Error(), AllOf(HasSubstr("cannot hover: its right rotor has to give 95."),
                             HasSubstr("are 0 to 30 N"), HasSubstr("its left rotor")));
  Replace("<mass>19.25</mass>", "<mass>1.92509767079622</mass>");
  Replace("<lower>-1.5</lower><upper>1.5</upper>", "<lower>-1e-9</lower><upper>1e-9</upper>");
  EXPECT_THAT(Error(), HasSubstr("cannot hover: its right hinge has to stand at "));
}

TEST_F(ChangedVehicle, InertiaIsCheckedBeforeTheRoles) {
  Replace("<iyy>0.00792827006001647</iyy>", "<iyy>-0.00792827006001647</iyy>");
  Replace("<tiltproof:base link=\"body\"/>", "");
  EXPECT_THAT(Error(), AllOf(HasSubstr("'body'"), HasSubstr("not positive definite")));
}

TEST_F(ChangedVehicle, InertialFrameIsTurnedIntoTheLinks) {
  // A quarter turn about z swaps x and y.
  Replace("<mass>0.080943968597</mass>",
          "<mass>0.080943968597</mass><pose>0 0 0 0 0 1.57079632679489662</pose>");
  const RigidBody body = Load().hinges[1].body;
  EXPECT_NEAR(body.inertia_kg_m2(0, 0), 1.04858690e-04, 1e-15);
  EXPECT_NEAR(body.inertia_kg_m2(1, 1), 3.83153586e-05, 1e-15);
}

TEST_F(ChangedVehicle, JointToNowhere) {
  Replace("<child>thruster_left</child>", "<child>thruster_lfet</child>");
  EXPECT_THAT(Error(), AllOf(HasSubstr("'hinge_left'"), HasSubstr("'thruster_lfet' does not exist")));
  EXPECT_EQ(line_, changed_line_);
}

TEST_F(ChangedVehicle, JointOfAnotherType) {
  Replace("name=\"hinge_left\" type=\"revolute\"", "name=\"hinge_left\" type=\"prismatic\"");
  EXPECT_THAT(Error(), AllOf(HasSubstr("'hinge_left'"), HasSubstr("revolute")));
  EXPECT_EQ(line_, changed_line_);
}

TEST_F(ChangedVehicle, JointWithoutStops) {
  Replace("<lower>-1.5</lower><upper>1.5</upper>", "");
  EXPECT_THAT(Error(), AllOf(HasSubstr("'hinge_right'"), HasSubstr("stops")));
}

TEST_F(ChangedVehicle, LinkOfNoJointOrTwo) {
  Replace("<joint name=\"hinge_right\"", "<link name=\"tail\"/><joint name=\"hinge_right\"");
  EXPECT_THAT(Error(), HasSubstr("link 'tail' must be the child of one joint, is that of 0"));
  Replace("<link name=\"tail\"/>",
          "<joint name=\"extra\" type=\"fixed\"><parent>body</parent><child>thruster_left</child></joint>");
  EXPECT_THAT(Error(), HasSubstr("link 'thruster_left' must be the child of one joint, is that of 2"));
}

TEST_F(ChangedVehicle, TwoLinksOfOneName) {
  Replace("<link name=\"thruster_left\">", "<link name=\"thruster_right\">");
  EXPECT_THAT(Error(), HasSubstr("a second link 'thruster_right'"));
}

TEST_F(ChangedVehicle, VersionThatIsNone) {
  const std::string original = text_;
  for (const std::string version : {"abc", "", "1", "1.", "1.9.1", "99999999999999999999.1", "-1.9"}) {
    text_ = original;
    Replace("version=\"1.9\"", "version=\"" + version + "\"");
    // The line is that of <sdf>, not that of the XML declaration, which holds a version, too.
    EXPECT_THAT(Error(), AllOf(HasSubstr("<sdf version=\"" + version + "\">"), Not(HasSubstr("stoi"))));
    EXPECT_EQ(line_, changed_line_);
  }
}

TEST_F(ChangedVehicle, EverythingWrongIsToldAtOnceInTheOrderOfTheFile) {
  Replace("<iyy>0.00792827006001647</iyy>", "<iyy>-0.00792827006001647</iyy>");
  Replace("<mass>0.080943968597</mass>", "<mass>-0.1</mass>");
  Replace("<child>thruster_left</child>", "<child>thruster_lfet</child>");
  Replace("<tiltproof:base link=\"body\"/>", "<tiltproof:base/>");
  Replace("direction=\"1\"", "direction=\"0.5\"");
  Replace("drag_ratio_m=\"0.0178947368\"", "drag_ratio=\"0.0178947368\"");
  Replace("joint=\"hinge_right\"", "joint=\"hinge_rihgt\"");
  Error();
  std::vector<std::string> lines;
  std::istringstream text(what_);
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  const auto place = [&](int line, const std::string& message) {
    return AllOf(::testing::StartsWith(file_.string() + ":" + std::to_string(line) + ": "),
                 HasSubstr(message));
  };
  EXPECT_THAT(
      lines, ElementsAre(place(15, "'body': impossible inertia"), place(44, "the mass must be positive"),
                         place(63, "'thruster_lfet' does not exist"), place(71, "needs the attribute 'link'"),
                         place(72, "no attribute 'drag_ratio'"), place(72, "'direction' must be 1 or -1"),
                         place(76, "'hinge_rihgt' does not exist"),
                         "to copy into <tiltproof:vehicle>, with the numbers of your vehicle:",
                         "    <tiltproof:base link=\"body\"/>"));
}

// The elements that the error offers make the file complete.
TEST_F(ChangedVehicle, MissingElementsCanBeCopied) {
  const std::string original = text_;
  const auto copied_from_error = [&] {
    Error();
    const std::size_t begin = what_.find('<', what_.find(", with the numbers of your vehicle:\n"));
    EXPECT_NE(begin, std::string::npos) << what_;
    return begin == std::string::npos ? "" : what_.substr(begin);
  };
  const std::size_t begin = text_.find("<tiltproof:vehicle"), end = text_.find("</model>");
  text_.erase(begin, end - begin);
  const std::string vehicle = copied_from_error();
  text_.insert(begin, vehicle);
  EXPECT_EQ(Load().hinges[0].body.link, "thruster_right");

  for (const std::string gone :
       {"<tiltproof:base ", "<tiltproof:thruster name=\"right\"", "<tiltproof:thruster name=\"left\"",
        "<tiltproof:servo joint=\"hinge_right\"", "<tiltproof:servo joint=\"hinge_left\""}) {
    text_ = original;
    const std::size_t from = text_.find(gone);
    text_.erase(from, text_.find("/>", from) + 2 - from);
    const std::string element = copied_from_error();
    // The rotor's old name is thruster.
    EXPECT_THAT(element,
                ::testing::StartsWith(std::regex_replace(gone, std::regex("thruster name"), "rotor name")));
    text_.insert(from, element);
    EXPECT_EQ(Load().hinges[0].body.link, "thruster_right") << gone;
  }
}

TEST_F(ChangedVehicle, NoRoles) {
  Replace("<tiltproof:vehicle", "<!--");
  Replace("</tiltproof:vehicle>", "-->");
  EXPECT_THAT(Error(), HasSubstr("vehicle.tiltproof.xml"));
}

TEST_F(ChangedVehicle, MissingRole) {
  Replace("<tiltproof:base link=\"body\"/>", "");
  EXPECT_THAT(Error(), HasSubstr("tiltproof:base"));
}

TEST_F(ChangedVehicle, OneThrusterTooFew) {
  Replace("<tiltproof:thruster name=\"left\"", "<!--");
  Replace("<tiltproof:servo", "--><tiltproof:servo");
  EXPECT_THAT(Error(), HasSubstr("servo joint 'hinge_left' carries no rotor"));
}

TEST_F(ChangedVehicle, RoleOfAnUnknownLink) {
  Replace("link=\"thruster_right\"", "link=\"thruster_rihgt\"");
  EXPECT_THAT(Error(), HasSubstr("'thruster_rihgt' does not exist"));
  EXPECT_EQ(line_, changed_line_);
}

TEST_F(ChangedVehicle, ServoOfAnUnknownJoint) {
  Replace("<tiltproof:servo joint=\"hinge_left\"", "<tiltproof:servo joint=\"hinge_lfet\"");
  EXPECT_THAT(Error(), HasSubstr("'hinge_lfet' does not exist"));
  EXPECT_EQ(line_, changed_line_);
}

TEST_F(ChangedVehicle, ServoTwiceOnOneJoint) {
  Replace("<tiltproof:servo joint=\"hinge_left\"", "<tiltproof:servo joint=\"hinge_right\"");
  EXPECT_THAT(Error(), AllOf(HasSubstr("no servo's joint has rotor link 'thruster_left'"),
                             HasSubstr("a second servo of joint 'hinge_right'")));
}

TEST_F(ChangedVehicle, MistypedAttributesAndNumbers) {
  const std::string original = text_;
  const auto error_with = [&](const std::string& from, const std::string& to) {
    text_ = original;
    Replace(from, to);
    const std::string message = Error();
    EXPECT_EQ(line_, changed_line_) << message;
    return message;
  };
  EXPECT_THAT(error_with("drag_ratio_m=\"0.0178947368\"", "drag_ratio=\"0.0178947368\""),
              HasSubstr("'drag_ratio'"));
  EXPECT_THAT(error_with("drag_ratio_m=\"0.0178947368\"", "drag_ratio_m=\"0.0178947368m\""),
              HasSubstr("a number"));
  EXPECT_THAT(error_with("drag_ratio_m=\"0.0178947368\"", "drag_ratio_m=\"nan\""), HasSubstr("a number"));
  EXPECT_THAT(error_with("drag_ratio_m=\"0.0178947368\"", "drag_ratio_m=\"-1\""), HasSubstr("[0, 10]"));
  EXPECT_THAT(error_with("direction=\"1\"", "direction=\"0.5\""), HasSubstr("1 or -1"));
  EXPECT_THAT(error_with("axis=\"0 0 1\"", "axis=\"0 0\""), HasSubstr("three numbers"));
  EXPECT_THAT(error_with("axis=\"0 0 1\"", "axis=\"0 0 0\""), HasSubstr("not all zero"));
  EXPECT_THAT(error_with("axis=\"0 0 1\"", "axis=\"0 0 1 0\""), HasSubstr("three numbers"));
  EXPECT_THAT(error_with("name=\"right\" link", "name=\"middle\" link"), HasSubstr("'right'"));
  EXPECT_THAT(error_with("<tiltproof:sensors/>", "<tiltproof:sensors rate_hz=\"0\"/>"), HasSubstr("rate_hz"));
  EXPECT_THAT(error_with("<tiltproof:sensors/>", "<tiltproof:sensor/>"), HasSubstr("<tiltproof:sensor>"));
  EXPECT_THAT(error_with("<tiltproof:sensors/>", "<tiltproof:drag linear_n_s_m=\"-0.1\"/>"),
              HasSubstr("[0, 100]"));
  EXPECT_THAT(error_with("<tiltproof:sensors/>", "<tiltproof:drag area_m2=\"0.1\"/>"),
              HasSubstr("'area_m2'"));
  EXPECT_THAT(error_with("<tiltproof:sensors/>", "<tiltproof:drag/><tiltproof:drag/>"),
              HasSubstr("one <tiltproof:drag>"));
  EXPECT_THAT(error_with("torque_max_nm=\"2\"", "torque_max_nm=\"0\""), HasSubstr("no limit"));
}

TEST_F(ChangedVehicle, ThrustersOfOtherNamesKeepThemAndTheirOrder) {
  Replace("name=\"right\" link=\"thruster_right\"", "name=\"a\" link=\"thruster_right\"");
  Replace("name=\"left\" link=\"thruster_left\"", "name=\"b\" link=\"thruster_left\"");
  const VehicleModel model = Load();
  EXPECT_EQ(model.hinges[0].body.link, "thruster_right");
  EXPECT_EQ(model.signals().inputs[0].name, "f_a_n");
}

TEST_F(ChangedVehicle, ThrustersWithRolesCountByName) {
  Replace("name=\"right\" link=\"thruster_right\"", "name=\"left\" link=\"thruster_right\"");
  Replace("name=\"left\" link=\"thruster_left\"", "name=\"right\" link=\"thruster_left\"");
  EXPECT_EQ(Load().hinges[0].body.link, "thruster_left");
}

TEST_F(ChangedVehicle, WarnsOfWhatHasNoEffect) {
  Replace("<link name=\"thruster_right\">",
          "<include_me/><plugin name=\"wind\" filename=\"w.so\"/>\n<link name=\"thruster_right\">"
          "<sensor name=\"eye\" type=\"camera\"/>");
  Load();
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("<include_me>"), HasSubstr("<plugin name=\"wind\">"),
                                     AllOf(HasSubstr("<sensor name=\"eye\">"), HasSubstr("'camera'"),
                                           HasSubstr("'thruster_right'"))));
}

TEST_F(ChangedVehicle, JointFrictionIsWarnedOf) {
  Replace("<effort>2</effort></limit>",
          "<effort>2</effort></limit><dynamics><damping>0.1</damping><friction>0</friction></dynamics>");
  Load();
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("<damping>"), HasSubstr("'hinge_right'"))));
}

TEST_F(ChangedVehicle, MappingFileGoesBeforeTheModelsOwnElements) {
  std::ofstream(folder_ / "roles.xml")
      << "<tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'>"
         "<tiltproof:base link='body'/>"
         "<tiltproof:thruster link='thruster_right' direction='1' drag_ratio_m='0.02' "
         "force_min_n='1' force_max_n='20'/>"
         "<tiltproof:thruster link='thruster_left' direction='-1' drag_ratio_m='0.02' "
         "force_max_n='21'/>"
         "<tiltproof:servo joint='hinge_left' torque_max_nm='3'/>"
         "<tiltproof:servo joint='hinge_right'/>"
         "<tiltproof:sensors rate_hz='100'/></tiltproof:vehicle>";
  const VehicleModel model = Load({.allow_invalid_inertia = false, .mapping = folder_ / "roles.xml"});
  EXPECT_EQ(model.InputMin(), (std::vector<double>{1, 0, -2, -3}));
  EXPECT_EQ(model.InputMax(), (std::vector<double>{20, 21, 2, 3}));
  EXPECT_EQ(model.sensor_rate_hz, 100);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("overridden by")));
  EXPECT_THAT(Error({.allow_invalid_inertia = false, .mapping = folder_ / "none.xml"}),
              HasSubstr("no such file"));
}

TEST_F(ChangedVehicle, ThatCannotHover) {
  // Thrusters that push sideways.
  Replace("axis=\"0 0 1\"", "axis=\"0 1 0\"");
  Replace("axis=\"0 0 1\"", "axis=\"0 1 0\"");
  EXPECT_THAT(Error(), HasSubstr("no hover"));
}

}  // namespace
}  // namespace tiltproof::plant
