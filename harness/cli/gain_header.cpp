#include "harness/cli/gain_header.h"

#include <fmt/format.h>

#include <vector>

#include "plant/dynamics.h"

namespace tiltproof::harness {
namespace {

// Nine digits determine a binary32. A whole number needs a point to be a floating literal.
std::string Literal(double value) {
  std::string number = fmt::format("{:.9g}", static_cast<double>(static_cast<float>(value)));
  if (number.find_first_of(".e") == std::string::npos) number += ".0";
  return number + "f";
}

std::string ListOfNumbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + Literal(value);
  return "{" + text + "}";
}

std::string ListOfNames(const SignalTable& signals) {
  std::string text;
  for (const Signal& signal : signals) text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", signal.name);
  return "{" + text + "}";
}

// A comment must not end early.
std::string InComment(std::string text) {
  for (std::size_t at = 0; (at = text.find("*/", at)) != std::string::npos;) text.replace(at, 2, "* /");
  return text;
}

}  // namespace

std::string GainHeader(const plant::VehicleModel& model, const plant::LqrDesign& design) {
  const VehicleSignals signals = model.signals();
  const plant::Coordinates<double> q = plant::HoverCoordinates(design.hover);
  std::vector<double> state(q.data(), q.data() + q.size());
  state.resize(2 * state.size(), 0.0);
  std::string rows;
  for (Eigen::Index i = 0; i < design.gain.rows(); ++i) {
    std::vector<double> row;
    for (Eigen::Index j = 0; j < design.gain.cols(); ++j) row.push_back(design.gain(i, j));
    rows += (i == 0 ? "\n    " : ",\n    ") + ListOfNumbers(row);
  }
  const SignalTable states(std::vector<Signal>(
      signals.states.begin(), signals.states.begin() + static_cast<std::ptrdiff_t>(state.size())));
  std::string text = fmt::format(
      "/* Controller of '{}', written by `tiltproof design-lqr --header`.\n"
      " *\n"
      " *   u = lqr_hover_input - lqr_gain * (x - lqr_hover_state - x_ref), once per lqr_period_s, within "
      "lqr_input_min\n"
      " *   and lqr_input_max. x has the states lqr_state_names (SI units, rad; angular rates are those of "
      "the Euler\n"
      " *   angles), and then the integrals of the errors of x, y, z and yaw by the trapezoidal rule with "
      "the present\n"
      " *   error. The gain holds for a heading of 0: turn the errors of position and velocity by the "
      "heading. */\n",
      InComment(model.name));
  text += "#ifndef LQR_GAIN_H\n#define LQR_GAIN_H\n\n";
  text += fmt::format("enum {{ LQR_STATES = {}, LQR_INTEGRALS = {}, LQR_INPUTS = {} }};\n\n", state.size(),
                      plant::kIntegralCount, design.gain.rows());
  const auto array = [&](const char* type, const char* name, const char* size, const std::string& values) {
    text += fmt::format("static const {} {}[{}] = {};\n", type, name, size, values);
  };
  text += fmt::format("static const float lqr_period_s = {};\n", Literal(design.model.period_s));
  array("char* const", "lqr_state_names", "LQR_STATES", ListOfNames(states));
  array("char* const", "lqr_input_names", "LQR_INPUTS", ListOfNames(signals.inputs));
  array("float", "lqr_hover_state", "LQR_STATES", ListOfNumbers(state));
  array("float", "lqr_hover_input", "LQR_INPUTS", ListOfNumbers(design.hover.input));
  array("float", "lqr_input_min", "LQR_INPUTS", ListOfNumbers(model.InputMin()));
  array("float", "lqr_input_max", "LQR_INPUTS", ListOfNumbers(model.InputMax()));
  text += fmt::format(
      "static const float lqr_gain[LQR_INPUTS][LQR_STATES + LQR_INTEGRALS] = {{{}}};\n\n#endif\n", rows);
  return text;
}

}  // namespace tiltproof::harness
