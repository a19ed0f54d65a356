// The paper's controller, designed on a vehicle: discrete linear-quadratic regulator with integral action
// (section 3).
//
//   LqrDesign design = DesignLqr(LoadVehicle(file, {}, warnings));
//   std::cout << GainCsv(design.gain);
//   design.delay_margin_s;  // 0.009 for the design plant
//
// The design finds the vehicle's exact hover, linearises the equations of motion there and discretises them
// with a zero-order hold of the control period. The states are
//   q (n), q_dot (n), integrals of the errors of x, y, z, yaw (4)    q = x y z roll pitch yaw, each hinge's alpha
// with trapezoidal integrals that include the present error, and the law is u = u_eq - K (x - x_ref).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plant/dynamics.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

inline constexpr int kIntegralCount = 4;

// Rows are the vehicle's inputs, thrusts (N) and then torques (N m); columns are the states in their order. The
// tilt-rotor's is 4 x 20.
using GainMatrix = Eigen::MatrixXd;

// x(k+1) = a x(k) + b u(k), and the continuous model from which it was computed.
struct SampledModel {
  double period_s = 0;
  LinearModel continuous;
  Eigen::MatrixXd a;  // sizes as in LinearModel
  Eigen::MatrixXd b;
};
SampledModel Sample(const LinearModel& model, double period_s);

// Diagonals of the cost sum x'Qx + u'Ru, all positive.
struct LqrWeights {
  Eigen::VectorXd q;  // of the states
  Eigen::VectorXd r;  // of the inputs
};
// The weights that give the authors' published gain, for each kind of state and input of the vehicle. The paper
// prints two of them differently: for R it has sqrt(0.2), sqrt(0.05) where 1/0.2^2, 1/0.05^2 are meant, and for the
// rates of alpha 5/(9 pi^2) where 5/(9 pi)^2 is meant. An angle that is commanded weighs 1/0.2^2.
LqrWeights PaperWeights(const VehicleModel& model);
// Names of the weights: the states, integral_x_m_s ... integral_yaw_rad_s, and then the inputs.
std::vector<std::string> WeightNames(const VehicleModel& model);

// The weights of a vehicle of any size. They are the paper's, with those of thrusts and torques divided by the square of
// the vehicle's size: its weight against that of the paper's vehicle, times sqrt(2 / rotors), rounded to a power of two.
// So an acceleration costs about the same, and a vehicle of about the paper's size has exactly the paper's weights.
LqrWeights DefaultWeights(const VehicleModel& model);

// The delay that a default design must tolerate: 0.7 control periods, as the paper's design does, and the largest time
// constant of a rotor. The design's model has no rotor lag, and a lag delays a signal by its time constant at most.
double DelayToTolerate(const VehicleModel& model, double period_s);

struct LqrOptions {
  double period_s = 0.012;
  // By default DefaultWeights(), with those of all inputs multiplied by 4 until the closed loop tolerates
  // DelayToTolerate(), or does not tolerate more.
  std::optional<LqrWeights> weights;
};

struct LqrDesign {
  Hover hover;
  SampledModel model;
  GainMatrix gain;
  double spectral_radius = 0;  // of the closed loop without delay; < 1
  double dare_residual =
      0;  // largest element of the Riccati equation's residual, relative to the solution's largest
  int dare_iterations = 0;
  double delay_margin_s = 0;
  double input_weight_factor = 1;  // of the default design: 1, 4, 16, ...
};

// Throws DesignError when the vehicle has no hover, when no gain stabilises it, or when the weights have another
// size. The message names a motion that the inputs cannot control.
LqrDesign DesignLqr(const VehicleModel& model, const LqrOptions& options = {});
// Only the gain of the default design; quicker, and remembered for the last few vehicles. Not for several threads.
GainMatrix DesignGain(const VehicleModel& model, double period_s);

// Largest eigenvalue magnitude of the closed loop where u(k), computed from the state at k T, is in force
// from k T + delay until the next input takes over. delay_s in [0, kDelayMax_s].
double ClosedLoopSpectralRadius(const SampledModel& model, const GainMatrix& gain, double delay_s = 0);

// The largest delay_s such that the closed loop is stable with it and with every smaller delay; to 1 us.
// Negative when the loop is unstable without delay, kDelayMax_s when it is stable up to that.
inline constexpr double kDelayMax_s = 0.1;
double DelayMargin(const SampledModel& model, const GainMatrix& gain);

// One line per input, one number per state, comma separated, no header. Each number is the shortest text that reads
// back as the same double.
std::string GainCsv(const GainMatrix& gain);
// Throws std::runtime_error when the file cannot be written.
void WriteGainCsv(const std::filesystem::path& file, const GainMatrix& gain);
// Throws DesignError with the place in the file: a text that is no number, or other sizes.
GainMatrix ReadGainCsv(const std::filesystem::path& file, Eigen::Index rows, Eigen::Index columns);

// The definition `inline constexpr Gain <name> = {{...}};` of firmware/gain_tables.h in binary32. The firmware takes
// a gain of 4 x 20.
std::string FirmwareGainTable(const GainMatrix& gain, std::string_view name);

}  // namespace tiltproof::plant
