// Nonlinear model predictive control by multiple shooting and Gauss-Newton steps, one or a few in each period
// (real-time iterations: Diehl, Bock, Schloeder, SIAM J. Control Optim. 43, 2005).
//
//   std::unique_ptr<Planner> planner = MakePlanner(vehicle, options);   // null: no code for its hinges and rotors
//   const Work work = planner->Plan(start, disturbance, time_s, path);
//   std::vector<double> u = planner->InputAt(time_s);
//
// The horizon's intervals grow from one control period by a constant factor of at most 4. Each iteration integrates all intervals and
// their derivatives (on several threads, with equal results for every number of them), and solves one quadratic program.
// Its states start from the last plan, shifted by the time since then. The cost of the end is that of the linear-quadratic
// regulator at hover. Inputs have their limits. Roll and pitch stay in an octagon in the circle of the largest tilt, and the
// hinges within their stops; both are soft, with an exact penalty.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "firmware/examples/nmpc/dynamics.h"
#include "firmware/examples/nmpc/reference_preview.h"
#include "firmware/examples/nmpc/rotorcraft.h"

namespace tiltproof::nmpc {

struct Options {
  int intervals = 20;
  double horizon_s = 1.2;
  int iterations = 1;   // in each period
  int sweeps_max = 25;  // of the quadratic program
  int threads = 1;
  double tilt_max_rad = 0.5;
  double thrust_max_n = 0;  // of each rotor; 0: the vehicle's
  double compute_us = 0;    // of one sweep or integration of one interval
};

// Computed in one period.
struct Work {
  int sweeps = 0;     // of the quadratic programs
  int intervals = 0;  // integrations and sweeps of one interval, all together
};

class Planner {
 public:
  virtual ~Planner() = default;
  // Plans from `start`, which is at `time_s`, along `path`, whose points are at `time_s` and the ends of lengths_s().
  virtual Work Plan(const std::vector<double>& start, const Disturbance& disturbance, double time_s,
                    const std::vector<PathPoint>& path) = 0;
  // The plan becomes that of InputAt(). Until then, the plan before it is.
  virtual void Adopt() = 0;
  virtual std::vector<double> InputAt(double time_s) const = 0;
  // The state that follows when `input` stays for this long.
  virtual std::vector<double> Predict(const std::vector<double>& start, const std::vector<double>& input,
                                      const Disturbance& disturbance, double length_s) const = 0;
  virtual const std::vector<double>& lengths_s() const = 0;
};

// Reason that so few intervals cannot cover the horizon; empty: they can. `first_s`: the length of the first one.
std::string HorizonProblem(const Options& options, double first_s);

std::unique_ptr<Planner> MakePlanner(const Rotorcraft& vehicle, const Options& options);

}  // namespace tiltproof::nmpc
