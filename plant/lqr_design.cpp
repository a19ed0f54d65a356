#include "plant/lqr_design.h"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <iterator>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>
#include <utility>

namespace tiltproof::plant {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Each kind of product in an expression would be compiled by itself, for half a second.
MatrixXd Times(const MatrixXd& a, const MatrixXd& b) { return a * b; }
MatrixXd Times(const MatrixXd& a, const MatrixXd& b, const MatrixXd& c) { return Times(Times(a, b), c); }

struct Transition {
  MatrixXd a;  // e^{A t}
  MatrixXd b;  // integral of e^{A s} B over [0, t]
};

Transition Integrate(const LinearModel& model, double time_s) {
  // Van Loan: the exponential of [A B; 0 0] t holds both.
  const Index states = model.a.rows(), inputs = model.b.cols();
  MatrixXd generator = MatrixXd::Zero(states + inputs, states + inputs);
  generator.topLeftCorner(states, states) = model.a * time_s;
  generator.topRightCorner(states, inputs) = model.b * time_s;
  const MatrixXd exponential = generator.exp();
  return {exponential.topLeftCorner(states, states), exponential.topRightCorner(states, inputs)};
}

// Picks x, y, z and yaw.
MatrixXd IntegratedStates(Index state_count) {
  MatrixXd pick = MatrixXd::Zero(kIntegralCount, state_count);
  pick(0, 0) = pick(1, 1) = pick(2, 2) = pick(3, 5) = 1;
  return pick;
}

// The plant's step with the trapezoidal integrals appended: s(k+1) = s(k) + T/2 (e(k) + e(k+1)).
struct Augmented {
  MatrixXd a;
  MatrixXd b;
};
Augmented Augment(const SampledModel& model) {
  const Index states = model.a.rows(), all = states + kIntegralCount, inputs = model.b.cols();
  const MatrixXd half = 0.5 * model.period_s * IntegratedStates(states);
  Augmented augmented;
  augmented.a.setZero(all, all);
  augmented.a.topLeftCorner(states, states) = model.a;
  augmented.a.bottomLeftCorner(kIntegralCount, states) =
      Times(half, model.a + MatrixXd::Identity(states, states));
  augmented.a.bottomRightCorner(kIntegralCount, kIntegralCount).setIdentity();
  augmented.b.resize(all, inputs);
  augmented.b.topRows(states) = model.b;
  augmented.b.bottomRows(kIntegralCount) = Times(half, model.b);
  return augmented;
}

struct Riccati {
  MatrixXd x;
  double residual = 0;
  int iterations = 0;
};

// X = A'XA - A'XB (R + B'XB)^-1 B'XA + Q by the structure-preserving doubling algorithm (Chu, Fan, Lin, Wang,
// 2004), which converges quadratically when the pair is stabilisable.
Riccati SolveRiccati(const Augmented& model, const LqrWeights& weights) {
  const MatrixXd identity = MatrixXd::Identity(model.a.rows(), model.a.rows());
  const MatrixXd q = weights.q.asDiagonal();
  const MatrixXd r = weights.r.asDiagonal();
  MatrixXd a = model.a;
  const MatrixXd r_inverse = weights.r.cwiseInverse().asDiagonal();
  MatrixXd g = Times(model.b, r_inverse, model.b.transpose());
  MatrixXd h = q;

  constexpr int kIterationsMax = 60;
  for (int iteration = 1; iteration <= kIterationsMax; ++iteration) {
    const Eigen::PartialPivLU<MatrixXd> w(identity + Times(g, h));
    const MatrixXd w_a = w.solve(a);
    const MatrixXd w_g = w.solve(g);
    const MatrixXd h_step = Times(a.transpose(), h, w_a);
    g += Times(a, w_g, a.transpose());
    h += 0.5 * (h_step + h_step.transpose());
    a = Times(a, w_a);
    if (!h.allFinite()) break;
    const double scale = h.cwiseAbs().maxCoeff();
    if (h_step.cwiseAbs().maxCoeff() > 1e-15 * scale) continue;

    const MatrixXd xa = Times(h, model.a), xb = Times(h, model.b);
    const MatrixXd b_xa = Times(model.b.transpose(), xa), s = r + Times(model.b.transpose(), xb);
    const MatrixXd error =
        Times(model.a.transpose(), xa) - Times(b_xa.transpose(), s.ldlt().solve(b_xa)) + q - h;
    return {h, error.cwiseAbs().maxCoeff() / scale, iteration};
  }
  throw DesignError("the Riccati equation has no stabilising solution: the vehicle cannot be controlled");
}

// The coordinate that each state and integral belongs to.
Index CoordinateOf(Index state, Index coordinates) {
  constexpr std::array<Index, kIntegralCount> kIntegrated = {0, 1, 2, 5};
  if (state < 2 * coordinates) return state % coordinates;
  return kIntegrated[static_cast<std::size_t>(state - 2 * coordinates)];
}

// Throws DesignError when the inputs cannot control a motion that does not decay by itself (Popov, Belevitch, Hautus): a
// combination w of states with w'A = lambda w' and w'B = 0, Re lambda >= 0. An integral of an error is a state, too.
void CheckStabilisable(const VehicleModel& vehicle, const LinearModel& model) {
  const Index states = model.a.rows(), all = states + kIntegralCount, inputs = model.b.cols();
  MatrixXd a = MatrixXd::Zero(all, all);
  a.topLeftCorner(states, states) = model.a;
  a.bottomLeftCorner(kIntegralCount, states) = IntegratedStates(states);
  // A chain of integrators has the eigenvalue 0, which is found only roughly.
  constexpr double kNearZero = 1e-2, kRank = 1e-10;
  std::vector<std::complex<double>> growing = {0};
  const Eigen::VectorXcd own = Eigen::EigenSolver<MatrixXd>(a, false).eigenvalues();
  for (Index i = 0; i < own.size(); ++i)
    if (std::abs(own[i]) > kNearZero && own[i].real() > 0) growing.push_back(own[i]);
  for (const std::complex<double>& value : growing) {
    // The real and the imaginary part of w side by side: (A' - re) w_re + im w_im = 0, (A' - re) w_im - im w_re = 0.
    MatrixXd pencil = MatrixXd::Zero(2 * (all + inputs), 2 * all);
    const MatrixXd identity = MatrixXd::Identity(all, all);
    for (const Index half : {Index{0}, Index{1}}) {
      pencil.block(half * all, half * all, all, all) = a.transpose() - value.real() * identity;
      pencil.block(half * all, (1 - half) * all, all, all) =
          (half == 0 ? value.imag() : -value.imag()) * identity;
      pencil.block(2 * all + half * inputs, half * all, inputs, states) = model.b.transpose();
    }
    Eigen::FullPivLU<MatrixXd> lu(pencil);
    lu.setThreshold(kRank);
    if (lu.rank() == 2 * all) continue;
    Index largest = 0;
    const MatrixXd kernel = lu.kernel();
    kernel.col(0).cwiseAbs().maxCoeff(&largest);
    largest %= all;
    const Index coordinate = CoordinateOf(largest, states / 2);
    throw DesignError(
        fmt::format("the vehicle cannot be stabilised: its inputs cannot control {}. A thrust, a drag torque "
                    "(drag_ratio_m, with both directions) or a hinge must act on it",
                    vehicle.signals().states[static_cast<std::size_t>(coordinate)].name));
  }
}

}  // namespace

SampledModel Sample(const LinearModel& model, double period_s) {
  const Transition step = Integrate(model, period_s);
  return {.period_s = period_s, .continuous = model, .a = step.a, .b = step.b};
}

LqrWeights PaperWeights(const VehicleModel& model) {
  constexpr double pi2 = std::numbers::pi * std::numbers::pi;
  const auto hinges = static_cast<Index>(model.hinges.size()),
             rotors = static_cast<Index>(model.rotors.size());
  const Eigen::VectorXd angles = Eigen::VectorXd::Constant(hinges, 40 / pi2);
  const Eigen::VectorXd rates = Eigen::VectorXd::Constant(hinges, 5 / (81 * pi2));
  Eigen::VectorXd servos(hinges);
  for (Index i = 0; i < hinges; ++i)
    servos[i] = model.hinges[static_cast<std::size_t>(i)].servo == ServoMode::kTorque ? 400 : 25;
  LqrWeights weights{.q = Eigen::VectorXd(2 * CoordinateCount(model) + kIntegralCount),
                     .r = Eigen::VectorXd(InputCount(model))};
  weights.q << 5, 5, 5, 4 / pi2, 4 / pi2, 15 / pi2, angles,  //
      0.25, 0.25, 0.25, 9 / pi2, 9 / pi2, 16 / pi2, rates,   //
      50, 50, 50, 1;
  weights.r << Eigen::VectorXd::Constant(rotors, 25), servos;
  return weights;
}

std::vector<std::string> WeightNames(const VehicleModel& model) {
  std::vector<std::string> names;
  const VehicleSignals signals = model.signals();
  for (Index i = 0; i < 2 * CoordinateCount(model); ++i)
    names.push_back(signals.states[static_cast<std::size_t>(i)].name);
  for (const char* integral : {"x_m_s", "y_m_s", "z_m_s", "yaw_rad_s"})
    names.push_back(std::string("integral_") + integral);
  for (const Signal& input : signals.inputs) names.push_back(input.name);
  return names;
}

LqrWeights DefaultWeights(const VehicleModel& model) {
  constexpr double kPaperWeight_n = 20.55, kPaperRotors = 2;
  LqrWeights weights = PaperWeights(model);
  const auto rotors = static_cast<Index>(model.rotors.size());
  const double weight_n = model.MassTotal() * kGravity_m_s2;
  const double size = std::exp2(std::round(
      std::log2(weight_n / kPaperWeight_n * std::sqrt(kPaperRotors / static_cast<double>(rotors)))));
  for (Index i = 0; i < weights.r.size(); ++i) {
    const bool is_angle =
        i >= rotors && model.hinges[static_cast<std::size_t>(i - rotors)].servo == ServoMode::kPosition;
    if (!is_angle) weights.r[i] /= size * size;
  }
  return weights;
}

double DelayToTolerate(const VehicleModel& model, double period_s) {
  double lag_s = 0;
  for (const Rotor& rotor : model.rotors)
    lag_s = std::max({lag_s, rotor.time_constant_up_s, rotor.time_constant_down_s});
  return std::min(0.7 * period_s + lag_s, kDelayMax_s);
}

namespace {

// Fills in all but the delay margin.
void Solve(const LqrWeights& weights, LqrDesign& design) {
  const Augmented augmented = Augment(design.model);
  if (weights.q.size() != augmented.b.rows() || weights.r.size() != augmented.b.cols())
    throw DesignError(fmt::format("the vehicle has {} states and {} inputs, and the weights are {} and {}",
                                  augmented.b.rows(), augmented.b.cols(), weights.q.size(),
                                  weights.r.size()));
  const Riccati riccati = SolveRiccati(augmented, weights);
  const MatrixXd xb_transposed = Times(augmented.b.transpose(), riccati.x);
  const MatrixXd r = weights.r.asDiagonal();
  const MatrixXd s = r + Times(xb_transposed, augmented.b);
  design.gain = s.ldlt().solve(Times(xb_transposed, augmented.a));
  design.dare_residual = riccati.residual;
  design.dare_iterations = riccati.iterations;
  design.spectral_radius = ClosedLoopSpectralRadius(design.model, design.gain);
  if (!(design.spectral_radius < 1)) {
    throw DesignError(
        fmt::format("the designed closed loop is unstable: spectral radius {}", design.spectral_radius));
  }
}

// The number of quarters of the delay up to which the loop is stable: 4 for all of it.
int QuartersTolerated(const LqrDesign& design, double delay_s) {
  int quarters = 0;
  while (quarters < 4 &&
         ClosedLoopSpectralRadius(design.model, design.gain, delay_s * (quarters + 1) / 4) < 1)
    ++quarters;
  return quarters;
}

// All but the delay margin of the default design.
LqrDesign DefaultDesign(const VehicleModel& vehicle, const Hover& hover, const SampledModel& model) {
  constexpr int kTrialsMax = 10;
  const double delay_s = DelayToTolerate(vehicle, model.period_s);
  LqrWeights weights = DefaultWeights(vehicle);
  LqrDesign best;
  int most = -1;
  double factor = 1;
  for (int trial = 0; trial < kTrialsMax && most < 4; ++trial, factor *= 4, weights.r *= 4) {
    LqrDesign design;
    design.hover = hover;
    design.model = model;
    design.input_weight_factor = factor;
    try {
      Solve(weights, design);
    } catch (const DesignError&) {
      if (trial == 0) throw;
      break;
    }
    if (const int quarters = QuartersTolerated(design, delay_s); quarters > most) {
      most = quarters;
      best = std::move(design);
    }
  }
  return best;
}

}  // namespace

LqrDesign DesignLqr(const VehicleModel& model, const LqrOptions& options) {
  LqrDesign design;
  design.hover = SolveHover(model);
  design.model = Sample(Linearise(model, design.hover), options.period_s);
  CheckStabilisable(model, design.model.continuous);
  if (options.weights)
    Solve(*options.weights, design);
  else
    design = DefaultDesign(model, design.hover, design.model);
  design.delay_margin_s = DelayMargin(design.model, design.gain);
  return design;
}

GainMatrix DesignGain(const VehicleModel& model, double period_s) {
  // A run checks its scenarios before it flies them, and flies each of them with many seeds.
  struct Known {
    LinearModel model;
    double period_s, delay_s;
    GainMatrix gain;
  };
  static std::deque<Known> known;
  constexpr std::size_t kKnownMax = 16;
  const Hover hover = model.hover.input.empty() ? SolveHover(model) : model.hover;
  const LinearModel linear = Linearise(model, hover);
  const double delay_s = DelayToTolerate(model, period_s);
  const auto same = [](const MatrixXd& a, const MatrixXd& b) {
    return a.rows() == b.rows() && a.cols() == b.cols() && a == b;
  };
  for (const Known& each : known)
    if (each.period_s == period_s && each.delay_s == delay_s && same(each.model.a, linear.a) &&
        same(each.model.b, linear.b))
      return each.gain;
  CheckStabilisable(model, linear);
  GainMatrix gain = DefaultDesign(model, hover, Sample(linear, period_s)).gain;
  if (known.size() == kKnownMax) known.pop_front();
  known.push_back({linear, period_s, delay_s, gain});
  return gain;
}

double ClosedLoopSpectralRadius(const SampledModel& model, const GainMatrix& gain, double delay_s) {
  // With delay = (n + d) T, 0 <= d < 1, the period k begins with the rest of u(k-n-1) and goes on with
  // u(k-n):
  //   x(k+1) = a x(k) + e^{A (1-d) T} G(d T) u(k-n-1) + G((1-d) T) u(k-n),   G(t) = integral of e^{A s} B
  //   over [0, t].
  const double periods = std::floor(delay_s / model.period_s);
  const auto whole = static_cast<Index>(periods);
  const double rest_s = delay_s - periods * model.period_s;
  const Transition before = Integrate(model.continuous, rest_s);
  const Transition after = Integrate(model.continuous, model.period_s - rest_s);
  const MatrixXd b_old = Times(after.a, before.b);
  const Index states = model.a.rows(), all = states + kIntegralCount, inputs = model.b.cols();
  const MatrixXd half = 0.5 * model.period_s * IntegratedStates(states);

  // States: x, integrals, u(k-1), u(k-2), ..., u(k-n-1).
  const Index n = all + inputs * (whole + 1);
  MatrixXd a = MatrixXd::Zero(n, n);
  MatrixXd b = MatrixXd::Zero(n, inputs);  // what u(k) does at once
  a.topLeftCorner(states, states) = model.a;
  const auto past = [&](Index age) { return all + inputs * (age - 1); };
  a.block(0, past(whole + 1), states, inputs) = b_old;
  if (whole == 0) {
    b.topRows(states) = after.b;
  } else {
    a.block(0, past(whole), states, inputs) = after.b;
  }
  b.middleRows(past(1), inputs).setIdentity();
  for (Index age = 2; age <= whole + 1; ++age) {
    a.block(past(age), past(age - 1), inputs, inputs).setIdentity();
  }
  // Integrals: T/2 (e(k) + e(k+1)) on top of the present ones.
  auto integrals = a.middleRows(states, kIntegralCount);
  integrals = Times(half, a.topRows(states));
  integrals.leftCols(states) += half;
  integrals.middleCols(states, kIntegralCount).setIdentity();
  b.middleRows(states, kIntegralCount) = Times(half, b.topRows(states));

  a.leftCols(all) -= Times(b, gain);
  return Eigen::EigenSolver<MatrixXd>(a, false).eigenvalues().cwiseAbs().maxCoeff();
}

double DelayMargin(const SampledModel& model, const GainMatrix& gain) {
  const auto stable = [&](double delay_s) { return ClosedLoopSpectralRadius(model, gain, delay_s) < 1; };
  if (!stable(0)) return -1;
  // A loop can become unstable and stable again: walk in steps much shorter than its time constants, then
  // bisect.
  constexpr double kStep_s = 0.5e-3, kResolution_s = 1e-6;
  double low = 0, high = 0;
  do {
    low = high;
    high = low + kStep_s;
    if (high > kDelayMax_s) return kDelayMax_s;
  } while (stable(high));
  while (high - low > kResolution_s) {
    const double middle = 0.5 * (low + high);
    (stable(middle) ? low : high) = middle;
  }
  return low;
}

std::string GainCsv(const GainMatrix& gain) {
  std::string text;
  for (Index row = 0; row < gain.rows(); ++row) {
    for (Index column = 0; column < gain.cols(); ++column) {
      text += fmt::format("{}{}", column == 0 ? "" : ",", gain(row, column));
    }
    text += '\n';
  }
  return text;
}

void WriteGainCsv(const std::filesystem::path& file, const GainMatrix& gain) {
  std::ofstream out(file, std::ios::binary);
  out << GainCsv(gain);
  out.close();
  if (!out) throw std::runtime_error(file.string() + ": cannot be written");
}

GainMatrix ReadGainCsv(const std::filesystem::path& file, Index rows, Index columns) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw DesignError(fmt::format("{}: cannot be read", file.string()));
  const auto fail = [&](std::size_t line, std::size_t column, const std::string& what) {
    throw DesignError(fmt::format("{}:{}:{}: {}; `tiltproof design-lqr MODEL --csv FILE` writes such a file",
                                  file.string(), line, column, what));
  };
  GainMatrix gain(rows, columns);
  std::string line;
  Index row = 0;
  std::size_t number = 0;
  while (std::getline(in, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    if (row == rows) fail(number, 1, fmt::format("more than {} rows, one for each input", rows));
    std::size_t at = 0;
    Index column = 0;
    for (bool more = true; more; ++column) {
      const std::size_t comma = std::min(line.find(',', at), line.size());
      const std::string text = line.substr(at, comma - at);
      char* end = nullptr;
      const double value = std::strtod(text.c_str(), &end);
      if (text.empty() || *end != '\0' || !std::isfinite(value))
        fail(number, at + 1, fmt::format("'{}' is no number", text));
      if (column == columns)
        fail(number, at + 1,
             fmt::format("more than {} numbers: one for each state, and four integrals", columns));
      gain(row, column) = value;
      more = comma < line.size();
      at = comma + 1;
    }
    if (column < columns)
      fail(number, 1, fmt::format("{} numbers, and the vehicle needs {}", column, columns));
    ++row;
  }
  if (row < rows) fail(number + 1, 1, fmt::format("{} rows, and the vehicle has {} inputs", row, rows));
  return gain;
}

std::string FirmwareGainTable(const GainMatrix& gain, std::string_view name) {
  std::string text = fmt::format("inline constexpr Gain {} = {{{{\n", name);
  for (Index row = 0; row < gain.rows(); ++row) {
    text += "    {{";
    for (Index column = 0; column < gain.cols(); ++column) {
      // Nine digits determine a binary32. A whole number needs a point to be a floating literal.
      std::string number = fmt::format("{:.9g}", static_cast<double>(static_cast<float>(gain(row, column))));
      if (number.find_first_of(".e") == std::string::npos) number += ".0";
      text += fmt::format("{}{}F", column == 0 ? "" : ", ", number);
    }
    text += "}},\n";
  }
  return text + "}};\n";
}

}  // namespace tiltproof::plant
