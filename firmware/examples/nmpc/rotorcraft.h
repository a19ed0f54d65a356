// The vehicle as the controller knows it: rigid bodies, hinges with torque servos and rotors, as the harness describes
// them in the parameters (`geometry`, firmware/tiltproof_client.h).
//
//   std::string problem;
//   const std::optional<Rotorcraft> vehicle = ReadRotorcraft("{}", problem);
//   // nullopt: `problem` has the reason
//
// All vectors are in the main body's frame B (x forward, y left, z up) with all hinges at angle 0. SI units.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace tiltproof::nmpc {

struct Body {
  double mass_kg = 0;
  Eigen::Vector3d p_com_m = Eigen::Vector3d::Zero();            // centre of mass
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Identity();  // about the centre of mass
};

struct TiltHinge {
  Body body;
  Eigen::Vector3d p_hinge_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();  // unit
  double angle_min_rad = 0, angle_max_rad = 0;
};

struct Propeller {
  int hinge = -1;  // its place among the hinges; -1: on the main body
  Eigen::Vector3d p_rotor_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // of the thrust; unit
  double drag_ratio_m = 0;                          // torque about the axis per thrust, with its sign
};

struct Rotorcraft {
  double period_s = 0.012;
  Body base;
  std::vector<TiltHinge> hinges;
  std::vector<Propeller> rotors;
  // In the order of the inputs: the thrusts (N), then the hinges' torques (N m).
  std::vector<double> input_min, input_max, input_hover;
  double roll_hover_rad = 0, pitch_hover_rad = 0;
  std::vector<double> hinge_hover_rad;
};

// nullopt, with the reason in `problem`, for parameters without a geometry or hover, and for a vehicle with a position
// servo.
std::optional<Rotorcraft> ReadRotorcraft(const char* parameters, std::string& problem);

}  // namespace tiltproof::nmpc
