// The default design for vehicles of all kinds and sizes: stable, with its delay and its rotors' lag; and the errors for
// a vehicle or a file that gives no gain.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "plant/lqr_design.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Its arms follow from its mass, as published vehicles do: 0.03 kg have 0.05 m, 1.5 kg 0.25 m, 30 kg 1 m.
double ArmOf(double mass_kg) { return 0.22 * std::cbrt(mass_kg) * (mass_kg < 0.1 ? 0.7 : 1.3); }

VehicleModel SizedBody(double mass_kg) {
  const double arm_m = ArmOf(mass_kg);
  VehicleModel model;
  model.name = "vehicle";
  model.base.link = "body";
  model.base.mass_kg = mass_kg;
  model.base.inertia_kg_m2 = Vector3d(0.2, 0.22, 0.38).asDiagonal() * (mass_kg * arm_m * arm_m);
  return model;
}

Rotor SizedRotor(const VehicleModel& model, std::size_t count, std::size_t number, const Vector3d& p_m) {
  Rotor rotor;
  rotor.name = "m" + std::to_string(number);
  rotor.p_LR_m = p_m;
  rotor.direction = number % 2 == 0 ? 1 : -1;
  rotor.drag_ratio_m = 0.06 * ArmOf(model.base.mass_kg);
  rotor.force_max_n = 2.2 * model.base.mass_kg * 9.81 / static_cast<double>(count);
  return rotor;
}

// Rotors evenly on a circle, all on the body.
VehicleModel Multirotor(std::size_t count, double mass_kg, double lag_s = 0) {
  VehicleModel model = SizedBody(mass_kg);
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = (static_cast<double>(i) + 0.5) * 2 * std::numbers::pi / static_cast<double>(count);
    const double arm_m = ArmOf(mass_kg);
    model.rotors.push_back(
        SizedRotor(model, count, i, {arm_m * std::cos(angle), arm_m * std::sin(angle), 0.1 * arm_m}));
    model.rotors.back().time_constant_up_s = lag_s / 2;
    model.rotors.back().time_constant_down_s = lag_s;
  }
  return model;
}

// The same, with each rotor on a hinge of its own.
VehicleModel TiltRotor(std::size_t count, double mass_kg) {
  VehicleModel model = Multirotor(count, mass_kg);
  const double arm_m = ArmOf(mass_kg);
  model.base.p_com_m = {0.01 * arm_m, 0, -0.3 * arm_m};
  for (std::size_t i = 0; i < count; ++i) {
    Hinge hinge;
    hinge.name = model.rotors[i].name;
    hinge.joint = "joint" + std::to_string(i);
    hinge.body.mass_kg = 0.05 * mass_kg;
    hinge.body.inertia_kg_m2 = Vector3d(0.002, 0.002, 0.002).asDiagonal() * (mass_kg * arm_m * arm_m);
    hinge.p_BT_m = hinge.p_BH_m =
        count == 2 ? Vector3d(0, i == 0 ? -arm_m : arm_m, 0.1 * arm_m) : model.rotors[i].p_LR_m;
    hinge.angle_min_rad = -1;
    hinge.angle_max_rad = 1;
    hinge.torque_max_nm = mass_kg * arm_m;
    model.hinges.push_back(hinge);
    model.rotors[i].hinge = i;
    model.rotors[i].p_LR_m = {0, 0, 0.1 * arm_m};
  }
  return model;
}

// The distance from hover of the linear model after a while, with thrusts and torques that lag and arrive late. Its own
// integration: small steps of Euler's rule.
double LinearDeviation(const VehicleModel& model, const LqrDesign& design, double lag_s, double delay_s,
                       double time_s) {
  const LinearModel& linear = design.model.continuous;
  constexpr double kStep_s = 2e-4;
  const Eigen::Index states = linear.a.rows();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(states), error = Eigen::VectorXd::Zero(4),
                  integral = Eigen::VectorXd::Zero(4), last = error;
  x[0] = 0.3;
  x[1] = -0.2;
  x[2] = 0.1;
  x[3] = 0.05;
  x[5] = -0.1;
  const auto inputs = linear.b.cols();
  Eigen::VectorXd wanted = Eigen::VectorXd::Zero(inputs), before = wanted, in_force = wanted;
  const auto rotors = static_cast<Eigen::Index>(model.rotors.size());
  const auto steps_of_period = static_cast<int>(std::lround(design.model.period_s / kStep_s));
  const auto steps_of_delay = static_cast<int>(std::lround(delay_s / kStep_s));
  for (int step = 0; step < static_cast<int>(time_s / kStep_s); ++step) {
    if (step % steps_of_period == 0) {
      error << x[0], x[1], x[2], x[5];
      integral += design.model.period_s / 2 * (error + last);
      last = error;
      Eigen::VectorXd all(states + 4);
      all << x, integral;
      before = wanted;
      wanted = -design.gain * all;
    }
    const Eigen::VectorXd& command = step % steps_of_period < steps_of_delay ? before : wanted;
    for (Eigen::Index i = 0; i < inputs; ++i)
      in_force[i] +=
          i < rotors && lag_s > 0 ? kStep_s / lag_s * (command[i] - in_force[i]) : command[i] - in_force[i];
    x += kStep_s * (linear.a * x + linear.b * in_force);
  }
  return x.head(states / 2).norm();
}

class VehicleOfAnySize : public ::testing::TestWithParam<std::tuple<const char*, double>> {
 protected:
  static VehicleModel Make() {
    const auto& [kind, mass_kg] = GetParam();
    const std::string name = kind;
    VehicleModel model = name == "quad"        ? Multirotor(4, mass_kg)
                         : name == "hexa"      ? Multirotor(6, mass_kg)
                         : name == "octo"      ? Multirotor(8, mass_kg)
                         : name == "bi"        ? TiltRotor(2, mass_kg)
                         : name == "quad-tilt" ? TiltRotor(4, mass_kg)
                                               : Multirotor(4, mass_kg, 0.04);
    model.hover = SolveHover(model);
    return model;
  }
};
INSTANTIATE_TEST_SUITE_P(Sizes, VehicleOfAnySize,
                         ::testing::Combine(::testing::Values("quad", "hexa", "octo", "bi", "quad-tilt",
                                                              "lagging"),
                                            ::testing::Values(0.03, 0.3, 2.0, 30.0)));

TEST_P(VehicleOfAnySize, HasASoundDefaultDesign) {
  const VehicleModel model = Make();
  const LqrDesign design = DesignLqr(model);
  EXPECT_LT(design.spectral_radius, 1 - 1e-3);
  EXPECT_LT(design.dare_residual, 1e-9);
  EXPECT_GE(design.delay_margin_s, DelayToTolerate(model, 0.012) - 1e-6);
  // The line's delay, and a lag that the design left out.
  EXPECT_LT(LinearDeviation(model, design, model.rotors[0].time_constant_down_s, 0.004, 20), 0.03);
  // A displacement of 0.5 m asks for no more thrust than the rotors have.
  Eigen::VectorXd x = Eigen::VectorXd::Zero(design.gain.cols());
  x[0] = 0.5;
  const Eigen::VectorXd u = design.gain * x;
  for (std::size_t i = 0; i < model.rotors.size(); ++i)
    EXPECT_LT(std::abs(u[static_cast<Eigen::Index>(i)]), 0.8 * model.rotors[i].force_max_n);
  EXPECT_EQ(DesignGain(model, 0.012), design.gain);
  EXPECT_EQ(DesignGain(model, 0.012), design.gain);  // as remembered
}

TEST(DefaultWeights, OfTheShippedTiltRotorAreThePapers) {
  for (const char* name : {"tiltrotor", "tiltrotor_drag", "tiltrotor_published"}) {
    const VehicleModel model = LoadShipped(name);
    const LqrWeights paper = PaperWeights(model), own = DefaultWeights(model);
    EXPECT_EQ(own.q, paper.q);
    EXPECT_EQ(own.r, paper.r);
    EXPECT_EQ(DesignLqr(model).input_weight_factor, 1);
    EXPECT_EQ(DesignGain(model, 0.012), DesignLqr(model, {.period_s = 0.012, .weights = paper}).gain) << name;
  }
}

TEST(DesignLqr, HasOwnGainsForOtherPeriods) {
  const VehicleModel model = Multirotor(4, 1.5);
  const LqrDesign fast = DesignLqr(model, {.period_s = 0.004, .weights = {}});
  EXPECT_DOUBLE_EQ(fast.model.period_s, 0.004);
  EXPECT_GT(std::abs(fast.gain(0, 0) - DesignLqr(model).gain(0, 0)), 1e-6);
  EXPECT_LT(LinearDeviation(model, fast, 0, 0.002, 20), 0.03);
}

std::string DesignProblem(VehicleModel model) {
  try {
    model.hover = SolveHover(model);
    DesignLqr(model);
    return "designed";
  } catch (const DesignError& error) {
    return error.what();
  }
}

TEST(DesignLqr, NamesTheMotionThatTheInputsCannotControl) {
  VehicleModel no_drag = Multirotor(4, 1.5);
  for (Rotor& rotor : no_drag.rotors) rotor.drag_ratio_m = 0;
  EXPECT_THAT(DesignProblem(no_drag), AllOf(HasSubstr("cannot control yaw_rad"), HasSubstr("drag_ratio_m")));

  VehicleModel in_line = Multirotor(4, 1.5);  // four rotors along x: nothing rolls it
  for (std::size_t i = 0; i < 4; ++i) in_line.rotors[i].p_LR_m = {i < 2 ? 0.2 : -0.2, 0, 0};
  const std::string problem = DesignProblem(in_line);
  EXPECT_TRUE(problem.find("cannot control roll_rad") != std::string::npos ||
              problem.find("cannot control y_m") != std::string::npos)
      << problem;
}

class GainFile : public ::testing::Test {
 protected:
  ~GainFile() override { std::filesystem::remove(file_); }
  std::string Problem(const std::string& text) {
    std::ofstream(file_) << text;
    try {
      ReadGainCsv(file_, 2, 3);
      return "read";
    } catch (const DesignError& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.find(file_.string()), 0U);
      return what.substr(file_.string().size());
    }
  }
  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("tiltproof-read-gain-" + std::to_string(::getpid()) + ".csv");
};

TEST_F(GainFile, ReadsWhatWasWritten) {
  const GainMatrix gain = DesignLqr(Multirotor(4, 1.5)).gain;
  WriteGainCsv(file_, gain);
  EXPECT_EQ(ReadGainCsv(file_, 4, 16), gain);
}

TEST_F(GainFile, EachMistakeHasItsPlace) {
  EXPECT_EQ(Problem("1,2,3\r\n4,5,6\r\n\r\n"), "read");
  EXPECT_THAT(Problem("1,2,3\n4,x5,6\n"), HasSubstr(":2:3: 'x5' is no number"));
  EXPECT_THAT(Problem("1,2,3\n4,,6\n"), HasSubstr(":2:3: '' is no number"));
  EXPECT_THAT(Problem("1,2,3\n4,nan,6\n"), HasSubstr(":2:3: 'nan' is no number"));
  EXPECT_THAT(Problem("1,2,3,4\n4,5,6\n"), HasSubstr(":1:7: more than 3 numbers"));
  EXPECT_THAT(Problem("1,2\n"), HasSubstr(":1:1: 2 numbers, and the vehicle needs 3"));
  EXPECT_THAT(Problem("1,2,3\n"), HasSubstr(":2:1: 1 rows, and the vehicle has 2 inputs"));
  EXPECT_THAT(Problem("1,2,3\n4,5,6\n7,8,9\n"), HasSubstr(":3:1: more than 2 rows"));
  EXPECT_THROW(ReadGainCsv("/nonexistent.csv", 2, 3), DesignError);
}

}  // namespace
}  // namespace tiltproof::plant
