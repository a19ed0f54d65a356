// A vehicle: a main body, the bodies that tilt on it about hinges, and rotors on either. It is read from an SDF
// file.
//
//   std::vector<std::string> warnings;
//   VehicleModel model = LoadVehicle("plant/models/tiltrotor.sdf", {}, warnings);
//   model.signals().inputs[0].name;  // "f_r_n"
//   model.HoverInput()[0];           // 10.27
//
// Required contents of the file: docs/vehicle.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "link/signal_table.h"
#include "plant/sensors.h"
#include "plant/surroundings.h"

namespace tiltproof::plant {

inline constexpr double kGravity_m_s2 = 9.81;  // along -z of the world (paper, Table 1)

struct VehicleProblem {
  std::filesystem::path file;
  int line = 0;  // from 1; 0: unknown
  std::string message;
};

// A vehicle file that cannot be used: all its errors, in the order of its lines. what() has one line
// "file:line: message" for each, without ":line" where line is 0, and then the advice, if any.
class VehicleError : public std::runtime_error {
 public:
  explicit VehicleError(std::vector<VehicleProblem> problems, const std::string& advice = {});
  VehicleError(std::filesystem::path file, int line, std::string message);
  const std::vector<VehicleProblem>& problems() const { return problems_; }

 private:
  std::vector<VehicleProblem> problems_;
};

struct RigidBody {
  std::string link;
  double mass_kg = 0;
  Eigen::Vector3d p_com_m = Eigen::Vector3d::Zero();  // centre of mass in the link frame
  Eigen::Matrix3d inertia_kg_m2 =
      Eigen::Matrix3d::Identity();  // about the centre of mass, axes of the link frame
};

// A shape that touches the ground, on the body of a hinge or on the main body.
struct CollisionShape {
  enum class Kind { kBox, kSphere, kCylinder };
  std::string link = {};                  // of the file
  std::optional<std::size_t> hinge = {};  // none: on the main body
  Kind kind = Kind::kBox;
  Eigen::Vector3d size_m =
      Eigen::Vector3d::Ones();  // box: edges; sphere: radius, -, -; cylinder: radius, length, -
  Eigen::Vector3d p_LS_m = Eigen::Vector3d::Zero();  // pose in the body's link frame
  Eigen::Matrix3d R_LS = Eigen::Matrix3d::Identity();
};

// Command of a hinge's servo: a torque, or an angle.
enum class ServoMode { kTorque, kPosition };

// A body T that tilts on the main body about the hinge H. The hinge angle alpha turns it about axis_B:
// R_BT(alpha) = Rot(axis_B, alpha) R_BT.
struct Hinge {
  std::string name;  // in the names of signals: that of its only rotor, else that of the joint
  std::string joint;
  RigidBody body;
  Eigen::Vector3d p_BT_m = Eigen::Vector3d::Zero();  // link frame in the base frame at alpha = 0
  Eigen::Matrix3d R_BT = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_BH_m = Eigen::Vector3d::Zero();   // a point of the hinge
  Eigen::Vector3d axis_B = Eigen::Vector3d::UnitY();  // unit
  double angle_min_rad = 0, angle_max_rad = 0;        // stops
  ServoMode servo = ServoMode::kTorque;
  double torque_max_nm = 0;                         // of the servo, either sign
  double speed_max_rad_s = 0, time_constant_s = 0;  // of a position servo: its limit, and its first-order lag
};

// A rotor on a body L: that of its hinge, or the main body. Its thrust pushes L at one point.
struct Rotor {
  std::string name;                                          // "right"
  std::optional<std::size_t> hinge;                          // none: fixed to the main body
  Eigen::Vector3d p_LR_m = Eigen::Vector3d::Zero();          // the point, in L's link frame
  Eigen::Vector3d thrust_axis_L = Eigen::Vector3d::UnitZ();  // unit, L's link frame
  double direction = 1;                                      // 1 or -1
  double drag_ratio_m = 0;
  double force_min_n = 0, force_max_n = 0;
  double time_constant_up_s = 0,
         time_constant_down_s = 0;  // first-order lag of a rising and a falling thrust
};

// Drag of the air on the main body: the force -(linear + quadratic |v|) v at its centre of mass, where v is
// its velocity relative to the air. The same in all directions, and without a torque.
struct BodyDrag {
  double linear_n_s_m = 0, quadratic_n_s2_m2 = 0;
  friend bool operator==(const BodyDrag&, const BodyDrag&) = default;
};

// Hover: yaw 0, all rates 0.
struct Hover {
  double roll_rad = 0, pitch_rad = 0;
  std::vector<double> hinge_rad;  // of each hinge
  std::vector<double> input;      // in the order of VehicleSignals::inputs
};

struct VehicleModel {
  std::string name;
  std::filesystem::path file;
  RigidBody base;
  std::vector<CollisionShape> shapes;  // one or more
  std::vector<Hinge> hinges;
  std::vector<Rotor> rotors;    // 1 to kRotorsMax (link/disturbance.h); each hinge carries one or more
  double sensor_rate_hz = 0;    // 0: at every step
  std::vector<Sensor> sensors;  // SDF's own, in the order of the file
  Surroundings surroundings;
  BodyDrag drag;         // none by default; the controller's design leaves it out
  Hover hover;           // of plant/dynamics.h, SolveHover; empty where there is none
  std::string no_hover;  // the reasons that it cannot hover, each with its place; empty: it can

  double MassTotal() const;
  // The body that carries the rotor.
  const RigidBody& Carrier(const Rotor& rotor) const {
    return rotor.hinge ? hinges[*rotor.hinge].body : base;
  }

  // Signals of hinges h and rotors i, in their order, with `right` and `left` spelled r and l:
  //   states   x_m y_m z_m roll_rad pitch_rad yaw_rad, alpha_<h>_rad, vx_m_s vy_m_s vz_m_s
  //            wx_rad_s wy_rad_s wz_rad_s, alpha_<h>_rad_s
  //   sensors  the same, and what the sensors of the file read (plant/sensors.h)
  //   inputs   f_<i>_n, then for each hinge tau_<h>_nm, or angle_<h>_rad of a position servo
  VehicleSignals signals() const;

  // Rows in the order of the inputs.
  const std::vector<double>& HoverInput() const { return hover.input; }
  std::vector<double> InputMin() const;
  std::vector<double> InputMax() const;
};

// Form of the main body's angular velocity: along the world's axes, along its own axes, or as derivatives of
// roll, pitch, yaw.
enum class RatesFrame { kWorld, kBody, kEuler };

struct LoadOptions {
  // A physically impossible inertia (not positive definite, or violating the triangle inequality) is a
  // warning, not an error.
  bool allow_invalid_inertia = false;
  // A vehicle that cannot hover loads, and VehicleModel::no_hover has the reasons. Nothing can fly it.
  bool allow_no_hover = false;
  // The file with the tiltproof elements; empty: `<stem>.tiltproof.xml` next to the model if it exists,
  // otherwise those in the model.
  std::filesystem::path mapping;
};

// Appends to `warnings` one line "file:line: text" each. Throws VehicleError.
VehicleModel LoadVehicle(const std::filesystem::path& file, const LoadOptions& options,
                         std::vector<std::string>& warnings);

// The files that the vehicle's file includes. Throws VehicleError when one cannot be read.
std::vector<std::filesystem::path> IncludedFiles(const std::filesystem::path& file);

// The reason that no rigid body can have this inertia (about its centre of mass); empty when one can.
std::string InertiaFault(const Eigen::Matrix3d& inertia_kg_m2);

}  // namespace tiltproof::plant
