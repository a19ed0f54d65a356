#include "plant/vehicle_model.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <string_view>
#include <utility>

namespace tiltproof::plant {
namespace {

// Sorted by their lines, those of the mapping file last; one line each, then the advice.
std::string Text(std::vector<VehicleProblem>& problems, const std::string& advice) {
  const std::filesystem::path first = problems.front().file;
  std::stable_sort(problems.begin(), problems.end(), [&](const VehicleProblem& a, const VehicleProblem& b) {
    return std::pair(a.file != first, a.line) < std::pair(b.file != first, b.line);
  });
  std::string text;
  for (const VehicleProblem& problem : problems) {
    if (!text.empty()) text += '\n';
    text += problem.file.string();
    if (problem.line > 0) text += fmt::format(":{}", problem.line);
    text += fmt::format(": {}", problem.message);
  }
  return advice.empty() ? text : text + '\n' + advice;
}

// In the names of signals. Only right and left are spelled by a letter.
std::string_view Spelled(const std::string& name) {
  return name == "right" ? "r" : name == "left" ? "l" : std::string_view(name);
}

}  // namespace

VehicleError::VehicleError(std::vector<VehicleProblem> problems, const std::string& advice)
    : std::runtime_error(Text(problems, advice)), problems_(std::move(problems)) {}

VehicleError::VehicleError(std::filesystem::path file, int line, std::string message)
    : VehicleError(std::vector<VehicleProblem>{{std::move(file), line, std::move(message)}}) {}

double VehicleModel::MassTotal() const {
  double mass_kg = base.mass_kg;
  for (const Hinge& hinge : hinges) mass_kg += hinge.body.mass_kg;
  return mass_kg;
}

VehicleSignals VehicleModel::signals() const {
  std::vector<Signal> states, inputs;
  const auto add = [](std::vector<Signal>& to, SignalFrame frame, std::initializer_list<const char*> names) {
    for (const char* each : names) to.push_back(SignalNamed(each, frame));
  };
  // One for each hinge or rotor.
  const auto add_each = [](std::vector<Signal>& to, const auto& parts, SignalFrame frame,
                           const char* pattern) {
    for (const auto& part : parts)
      to.push_back(SignalNamed(fmt::format(fmt::runtime(pattern), Spelled(part.name)), frame));
  };
  add(states, SignalFrame::kWorld, {"x_m", "y_m", "z_m"});
  add(states, SignalFrame::kEuler, {"roll_rad", "pitch_rad", "yaw_rad"});
  add_each(states, hinges, SignalFrame::kHinge, "alpha_{}_rad");
  add(states, SignalFrame::kWorld, {"vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"});
  add_each(states, hinges, SignalFrame::kHinge, "alpha_{}_rad_s");
  add_each(inputs, rotors, SignalFrame::kRotor, "f_{}_n");
  for (const Hinge& hinge : hinges) {
    const std::string_view spelled = Spelled(hinge.name);
    inputs.push_back(SignalNamed(hinge.servo == ServoMode::kPosition ? fmt::format("angle_{}_rad", spelled)
                                                                     : fmt::format("tau_{}_nm", spelled),
                                 SignalFrame::kHinge));
  }
  const std::vector<double> input_min = InputMin(), input_max = InputMax();
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    inputs[i].min = input_min[i];
    inputs[i].max = input_max[i];
  }
  SignalTable table(std::move(states));
  const SignalTable measured = SensorSignals(sensors);
  std::vector<Signal> sent(table.begin(), table.end());
  sent.insert(sent.end(), measured.begin(), measured.end());
  VehicleSignals signals{.states = table,
                         .sensors = SignalTable(std::move(sent)),
                         .inputs = SignalTable(std::move(inputs)),
                         .measured = measured};
  for (const Rotor& rotor : rotors) signals.rotors.push_back(rotor.name);
  for (const Hinge& hinge : hinges) signals.joints.push_back(hinge.joint);
  signals.feels_wind = drag != BodyDrag{};
  return signals;
}

std::vector<double> VehicleModel::InputMin() const {
  std::vector<double> row;
  for (const Rotor& rotor : rotors) row.push_back(rotor.force_min_n);
  for (const Hinge& hinge : hinges)
    row.push_back(hinge.servo == ServoMode::kPosition ? hinge.angle_min_rad : -hinge.torque_max_nm);
  return row;
}

std::vector<double> VehicleModel::InputMax() const {
  std::vector<double> row;
  for (const Rotor& rotor : rotors) row.push_back(rotor.force_max_n);
  for (const Hinge& hinge : hinges)
    row.push_back(hinge.servo == ServoMode::kPosition ? hinge.angle_max_rad : hinge.torque_max_nm);
  return row;
}

std::string InertiaFault(const Eigen::Matrix3d& inertia_kg_m2) {
  if (!inertia_kg_m2.allFinite()) return "not finite";
  const Eigen::Vector3d moments =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia_kg_m2, Eigen::EigenvaluesOnly).eigenvalues();
  const std::string values =
      fmt::format("principal moments {:.4g}, {:.4g}, {:.4g} kg m^2", moments[0], moments[1], moments[2]);
  if (!(moments[0] > 0)) return "not positive definite, " + values;
  // Flat plates lie on the border: leave room for rounding in the file.
  constexpr double kTolerance = 1e-6;
  if (moments[0] + moments[1] < moments[2] * (1 - kTolerance)) {
    return "violates the triangle inequality (the two smaller must add up to the largest or more), " + values;
  }
  return {};
}

}  // namespace tiltproof::plant
