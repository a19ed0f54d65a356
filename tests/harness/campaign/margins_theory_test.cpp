// Flown margins against linear theory: how much delay of the loop, and how weak an actuator, a hover survives.
//
// Two models of their own stand beside the plant: Lagrange's equations of the tilt-rotor, and a rigid body with four
// rotors. Both are linearised by differences and closed with the sampled law.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "harness/engine/engine.h"
#include "harness/run/client_parameters.h"
#include "plant/dynamics.h"
#include "tests/harness/campaign/linear_loop.h"
#include "tests/support/lagrange_model.h"
#include "tests/support/reference_controller.h"

namespace tiltproof::harness {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using tiltproof::testing::LinearLoop;
using Model = std::shared_ptr<const plant::VehicleModel>;

Model Load(const std::filesystem::path& file) {
  std::vector<std::string> warnings;
  return std::make_shared<const plant::VehicleModel>(plant::LoadVehicle(file, {}, warnings));
}
const std::filesystem::path kModels = std::filesystem::path(TILTPROOF_SOURCE_DIR) / "plant/models";

LinearLoop TiltRotorLoop(const plant::Hover& hover) {
  const tiltproof::testing::LagrangeModel model(tiltproof::testing::DesignPlant());
  VectorXd state = VectorXd::Zero(16);
  state.segment<2>(3) << hover.roll_rad, hover.pitch_rad;
  state.segment<2>(6) << hover.hinge_rad[0], hover.hinge_rad[1];
  const VectorXd input = VectorXd::Map(hover.input.data(), 4);
  const auto acceleration = [&](const VectorXd& x, const VectorXd& u) -> VectorXd {
    return model.Acceleration(x.head<8>(), x.tail<8>(), {u[0], u[1], u[2], u[3]});
  };
  EXPECT_LT(acceleration(state, input).norm(), 1e-6) << "the other model hovers there, too";
  LinearLoop loop = tiltproof::testing::Linearised(8, input, acceleration, state);
  const auto rows = tiltproof::testing::ReadGainCsv(std::filesystem::path(TILTPROOF_SOURCE_DIR) /
                                                    "tests/golden/dlqr_gain_published.csv");
  loop.gain.resize(4, 20);
  for (Index i = 0; i < 4; ++i)
    for (Index j = 0; j < 20; ++j)
      loop.gain(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  return loop;
}

// The shipped quadrotor as a rigid body, written out: mass and inertias are those of its body and of four rotors.
LinearLoop QuadrotorLoop(double lag_s, const MatrixXd& gain) {
  constexpr double kArm_m = 0.1202082, kRotor_kg = 0.009, kMass_kg = 0.68 + 4 * kRotor_kg;
  constexpr double kAcross_kg_m2 = 0.007 + 4 * kRotor_kg * kArm_m * kArm_m;
  const Eigen::Vector3d inertia_kg_m2(kAcross_kg_m2 + 4 * 1.755e-7, kAcross_kg_m2 + 4 * 7.50675e-6,
                                      0.012 + 8 * kRotor_kg * kArm_m * kArm_m + 4 * 7.66875e-6);
  const double x_m[] = {kArm_m, kArm_m, -kArm_m, -kArm_m}, y_m[] = {kArm_m, -kArm_m, -kArm_m, kArm_m};
  const double turn_m[] = {0.016, -0.016, 0.016, -0.016};  // torque about z for each newton
  LinearLoop loop;
  loop.a = MatrixXd::Zero(16, 16);  // q, q', thrusts in force
  loop.b = MatrixXd::Zero(16, 4);
  loop.a.block<6, 6>(0, 6).setIdentity();
  loop.a.block<3, 3>(6, 6).diagonal().setConstant(-0.146 / kMass_kg);
  loop.a(6, 4) = 9.81;
  loop.a(7, 3) = -9.81;
  for (Index i = 0; i < 4; ++i) {
    loop.a(8, 12 + i) = 1 / kMass_kg;
    loop.a(9, 12 + i) = y_m[i] / inertia_kg_m2[0];
    loop.a(10, 12 + i) = -x_m[i] / inertia_kg_m2[1];
    loop.a(11, 12 + i) = turn_m[i] / inertia_kg_m2[2];
    loop.a(12 + i, 12 + i) = -1 / lag_s;
    loop.b(12 + i, i) = 1 / lag_s;
  }
  loop.gain = gain;
  return loop;
}

// A copy of a shipped model with parts of its text changed.
Model Changed(const std::string& name, const std::vector<std::pair<std::string, std::string>>& changes) {
  std::ostringstream text;
  text << std::ifstream(kModels / name).rdbuf();
  std::string changed = text.str();
  for (const auto& [from, to] : changes) {
    EXPECT_NE(changed.find(from), std::string::npos) << from;
    for (std::size_t at = 0; (at = changed.find(from, at)) != std::string::npos; at += to.size())
      changed.replace(at, from.size(), to);
  }
  const auto file = std::filesystem::temp_directory_path() /
                    ("tiltproof-theory-" + std::to_string(::getpid()) + "-" + name);
  std::ofstream(file) << changed;
  const Model model = Load(file);
  std::filesystem::remove(file);
  return model;
}

// The limits of thrusts and torques are no part of the linear model.
Model StrongTiltRotor() {
  static const Model model = Changed("tiltrotor.sdf", {{"force_max_n=\"30\"", "force_max_n=\"300\""},
                                                       {"<effort>2</effort>", "<effort>20</effort>"}});
  return model;
}
// Its thrusts rise and fall alike, because a lag that differs is not linear.
Model StrongQuadrotor() {
  static const Model model =
      Changed("quadrotor.sdf", {{"force_max_n=\"6.0032\"", "force_max_n=\"60\""},
                                {"time_constant_down_s=\"0.025\"", "time_constant_down_s=\"0.0125\""}});
  return model;
}

// The last two windows of a flight, in which the motion is compared.
constexpr int kWindow_s = 40;
constexpr double kStill_rad_s = 1e-4;  // binary32 of the law leaves a little

// A hover that a small deviation disturbs at the start. Its criteria measure the motion in the last two windows.
FlightJob Hovering(const Model& model, const std::string& build, int settling_s) {
  const int duration_s = settling_s + 2 * kWindow_s;
  FlightJob job{.name = "hover", .scenario = {}, .model = model, .means = {}, .replay = {}};
  Scenario& scenario = job.scenario;
  scenario.name = "hover";
  scenario.firmware = build;
  scenario.duration_ns = duration_s * kNsPerS;
  scenario.step_ns = kNsPerMs;
  scenario.link.ideal = true;
  scenario.link.protocol = link::ForVehicle(scenario.link.protocol, model->signals());
  scenario.initial_position_m = {0, 0, 200};
  scenario.reference.path = HoverReference{.at_m = scenario.initial_position_m};
  scenario.initial_attitude_rad = {0.01, 0.01, 0.1};
  std::string motion = "abs(wx_rad_s) + abs(wy_rad_s) + abs(wz_rad_s)";
  if (!model->hinges.empty()) motion += " + abs(alpha_r_rad_s) + abs(alpha_l_rad_s)";
  for (const int before_s : {2 * kWindow_s, kWindow_s}) {
    const int begin_s = duration_s - before_s;
    scenario.criteria.push_back({.name = "from-" + std::to_string(begin_s),
                                 .stl = "always[" + std::to_string(begin_s) + "," +
                                        std::to_string(begin_s + kWindow_s) + "](" + motion + " <= 0)",
                                 .metric = {},
                                 .min = {},
                                 .max = {}});
  }
  return job;
}

faults::FaultSpec Fault(const std::string& id, const std::string& type,
                        std::map<std::string, faults::ParameterValue> parameters) {
  faults::FaultSpec fault;
  fault.id = id;
  fault.type = type;
  fault.parameters = std::move(parameters);
  return fault;
}

// Every actuator reacts that many steps late.
FlightJob Late(const Model& model, const std::string& build, const std::vector<std::string>& inputs,
               int delay_ms) {
  FlightJob job = Hovering(model, build, 10);
  for (const std::string& input : inputs)
    job.scenario.faults.push_back(
        Fault(input, "actuator.delay", {{"actuator", input}, {"delay_ms", static_cast<double>(delay_ms)}}));
  return job;
}

// The actuator delivers that share of each change of its command. An offset gives back what the share takes away in hover,
// so the flight begins in the equilibrium about which the linear model holds.
FlightJob Weak(const Model& model, const std::string& build, const std::vector<std::string>& inputs,
               std::size_t input, double factor) {
  // Faster motions must be gone: within 10 % of the quadrotor's margin the slowest takes 140 s to change by a factor of e.
  FlightJob job = Hovering(model, build, 60);
  const double lost = (1 - factor) * plant::SolveHover(*model).input[input];
  job.scenario.faults = {
      Fault("weak", "actuator.loss_of_effectiveness", {{"actuator", inputs[input]}, {"factor", factor}}),
      Fault("trim", "actuator.offset", {{"actuator", inputs[input]}, {"value", lost}})};
  return job;
}

// True if the motion dies down: the vehicle stays in the air, and moves less in the last window than in the one before.
bool IsStable(const FlightJob& job) {
  Engine engine({});
  std::future<FlightResult> flown = engine.Submit(job);
  while (!engine.idle()) engine.Poll();
  const Score score = flown.get().score;
  EXPECT_NE(score.verdict, Verdict::kError) << score.reason;
  std::vector<double> motion;
  for (const CriterionResult& criterion : score.criteria) {
    if (criterion.name == kSurvivalCriterion && criterion.verdict == Verdict::kFail) return false;
    if (criterion.name.starts_with("from-")) motion.push_back(-criterion.robustness.value());
  }
  return motion.at(1) < std::max(motion.at(0), kStill_rad_s);
}

// The last level that is stable, and the first that is not.
std::pair<double, double> Edge(double good, double bad, double tolerance,
                               const std::function<FlightJob(double)>& at) {
  while (std::abs(bad - good) > tolerance) {
    const double middle = (good + bad) / 2;
    (IsStable(at(middle)) ? good : bad) = middle;
  }
  return {good, bad};
}

const std::vector<std::string> kTiltRotorInputs = {"f_r", "f_l", "tau_r", "tau_l"};
const std::vector<std::string> kQuadrotorInputs = {"f_front_left", "f_front_right", "f_back_right",
                                                   "f_back_left"};

LinearLoop PaperLoop() { return TiltRotorLoop(plant::SolveHover(*StrongTiltRotor())); }
LinearLoop QuadrotorOfLqr() {
  return QuadrotorLoop(0.0125, GainOf(Hovering(StrongQuadrotor(), "lqr", 10).scenario, *StrongQuadrotor()));
}

void ExpectDelayMargin(const LinearLoop& loop, const Model& model, const std::string& build,
                       const std::vector<std::string>& inputs) {
  const double margin_ms = 1e3 * loop.DelayMargin_s();
  EXPECT_TRUE(IsStable(Late(model, build, inputs, static_cast<int>(std::ceil(margin_ms - 1))))) << margin_ms;
  EXPECT_FALSE(IsStable(Late(model, build, inputs, static_cast<int>(std::floor(margin_ms + 1)))))
      << margin_ms;
}

// Within 10 %.
void ExpectGainMargin(const LinearLoop& loop, const Model& model, const std::string& build,
                      const std::vector<std::string>& inputs, std::size_t input) {
  const double margin = loop.GainMargin(static_cast<Index>(input));
  EXPECT_TRUE(IsStable(Weak(model, build, inputs, input, 1.1 * margin))) << margin;
  EXPECT_FALSE(IsStable(Weak(model, build, inputs, input, 0.9 * margin))) << margin;
}

TEST(DelayMarginAgainstTheory, OfPaper) {
  EXPECT_NEAR(PaperLoop().DelayMargin_s(), 8.987e-3, 0.01e-3);
  ExpectDelayMargin(PaperLoop(), StrongTiltRotor(), "paper", kTiltRotorInputs);
}

TEST(DelayMarginAgainstTheory, OfTheQuadrotor) {
  ExpectDelayMargin(QuadrotorOfLqr(), StrongQuadrotor(), "lqr", kQuadrotorInputs);
}

TEST(GainMarginAgainstTheory, OfPapersThrust) {
  ExpectGainMargin(PaperLoop(), StrongTiltRotor(), "paper", kTiltRotorInputs, 0);
}

TEST(GainMarginAgainstTheory, OfPapersTorque) {
  ExpectGainMargin(PaperLoop(), StrongTiltRotor(), "paper", kTiltRotorInputs, 2);
}

TEST(GainMarginAgainstTheory, OfTheQuadrotorsThrust) {
  EXPECT_NEAR(QuadrotorOfLqr().GainMargin(0), 0.0837, 1e-4);
  ExpectGainMargin(QuadrotorOfLqr(), StrongQuadrotor(), "lqr", kQuadrotorInputs, 0);
}

// The table of docs/margins.md; some 100 flights:
//   margins_theory_test --gtest_also_run_disabled_tests --gtest_filter='*Table*'
TEST(MarginsAgainstTheory, DISABLED_Table) {
  const auto rows = [](const char* vehicle, const LinearLoop& loop, const Model& model, const char* build,
                       const std::vector<std::string>& inputs) {
    const double margin_ms = 1e3 * loop.DelayMargin_s();
    const auto late = Edge(0, std::ceil(margin_ms + 4), 1, [&](double level) {
      return Late(model, build, inputs, static_cast<int>(std::floor(level)));
    });
    std::printf("%-10s delay of all  theory %8.3f ms  stable %g unstable %g\n", vehicle, margin_ms,
                std::floor(late.first), std::floor(late.second));
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const double margin = loop.GainMargin(static_cast<Index>(i));
      const auto weak = Edge(1.3 * margin, 0.7 * margin, 0.02 * margin,
                             [&](double level) { return Weak(model, build, inputs, i, level); });
      std::printf("%-10s %-13s theory %8.4f     stable %.4f unstable %.4f\n", vehicle, inputs[i].c_str(),
                  margin, weak.first, weak.second);
      std::fflush(stdout);
    }
  };
  rows("tilt-rotor", PaperLoop(), StrongTiltRotor(), "paper", kTiltRotorInputs);
  rows("quadrotor", QuadrotorOfLqr(), StrongQuadrotor(), "lqr", kQuadrotorInputs);
}

}  // namespace
}  // namespace tiltproof::harness
