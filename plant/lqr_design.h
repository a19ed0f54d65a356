// The paper's controller, designed on a vehicle: discrete linear-quadratic regulator with integral action
// (section 3).
//
//   LqrDesign design = DesignLqr(LoadVehicle(file, {}, warnings));
//   std::cout << GainCsv(design.gain);
//   design.delay_margin_s;  // 0.009 for the design plant
//
// The design finds the vehicle's exact hover, linearises the equations of motion there and discretises them
// with a zero-order hold of 12 ms. The 20 states are
//   q (8), q_dot (8), integrals of the errors of x, y, z, yaw (4)    q = x y z roll pitch yaw alpha_r alpha_l
// with trapezoidal integrals that include the present error, and the law is u = u_eq - K (x - x_ref).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>

#include "plant/dynamics.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

inline constexpr int kPlantStateCount = 2 * kCoordinateCount;
inline constexpr int kIntegralCount = 4;
inline constexpr int kDesignStateCount = kPlantStateCount + kIntegralCount;

// The matrices of a design have their sizes at run time: with fixed sizes of 20, Eigen takes ten times as long
// to compile.
//
// 4 x 20. Rows f_r (N), f_l (N), tau_r (N m), tau_l (N m); columns in the order of the 20 states.
using GainMatrix = Eigen::MatrixXd;

// x(k+1) = a x(k) + b u(k), and the continuous model from which it was computed.
struct SampledModel {
  double period_s = 0;
  LinearModel continuous;
  Eigen::MatrixXd a;  // 16 x 16
  Eigen::MatrixXd b;  // 16 x 4
};
SampledModel Sample(const LinearModel& model, double period_s);

// Diagonals of the cost sum x'Qx + u'Ru, all positive.
struct LqrWeights {
  Eigen::VectorXd q;  // of the 20 states
  Eigen::VectorXd r;  // of the 4 inputs
};
// The weights that give the authors' published gain. The paper prints two of them differently: for R it has
// sqrt(0.2), sqrt(0.05) where 1/0.2^2, 1/0.05^2 are meant, and for the rates of alpha 5/(9 pi^2) where 5/(9
// pi)^2 is meant.
LqrWeights PaperWeights();

struct LqrOptions {
  double period_s = 0.012;
  LqrWeights weights = PaperWeights();
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
};

// Throws DesignError when the vehicle has no hover or no gain stabilises it.
LqrDesign DesignLqr(const VehicleModel& model, const LqrOptions& options = {});

// Largest eigenvalue magnitude of the closed loop where u(k), computed from the state at k T, is in force
// from k T + delay until the next input takes over. delay_s in [0, kDelayMax_s].
double ClosedLoopSpectralRadius(const SampledModel& model, const GainMatrix& gain, double delay_s = 0);

// The largest delay_s such that the closed loop is stable with it and with every smaller delay; to 1 us.
// Negative when the loop is unstable without delay, kDelayMax_s when it is stable up to that.
inline constexpr double kDelayMax_s = 0.1;
double DelayMargin(const SampledModel& model, const GainMatrix& gain);

// Four lines of 20 numbers, comma separated, no header, each the shortest text that reads back as the same
// double.
std::string GainCsv(const GainMatrix& gain);
// Throws std::runtime_error when the file cannot be written.
void WriteGainCsv(const std::filesystem::path& file, const GainMatrix& gain);

// The definition `inline constexpr Gain <name> = {{...}};` of firmware/gain_tables.h in binary32.
std::string FirmwareGainTable(const GainMatrix& gain, std::string_view name);

}  // namespace tiltproof::plant
