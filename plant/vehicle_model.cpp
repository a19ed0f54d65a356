#include "plant/vehicle_model.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <mutex>
#include <sdf/Box.hh>
#include <sdf/Collision.hh>
#include <sdf/Cylinder.hh>
#include <sdf/Geometry.hh>
#include <sdf/Joint.hh>
#include <sdf/JointAxis.hh>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <sdf/Sphere.hh>
#include <sstream>
#include <utility>

#include "plant/dynamics.h"
#include "plant/missing_elements.h"
#include "plant/vehicle_xml.h"

namespace tiltproof::plant {
namespace {

using ignition::math::Pose3d;

Eigen::Vector3d ToEigen(const ignition::math::Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }
Eigen::Matrix3d ToEigen(const ignition::math::Quaterniond& q) {
  const ignition::math::Matrix3d in(q);
  Eigen::Matrix3d out;
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column) {
      out(row, column) = in(static_cast<std::size_t>(row), static_cast<std::size_t>(column));
    }
  }
  return out;
}

// libsdformat, and the URDF reader that it falls back to, print to std::cerr besides returning errors. While
// one of these lives that text goes here.
class StderrCapture {
 public:
  StderrCapture() : lock_(Mutex()), previous_(std::cerr.rdbuf(text_.rdbuf())) {}
  ~StderrCapture() { std::cerr.rdbuf(previous_); }
  StderrCapture(const StderrCapture&) = delete;
  StderrCapture& operator=(const StderrCapture&) = delete;

 private:
  static std::mutex& Mutex() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> lock_;
  std::ostringstream text_;
  std::streambuf* previous_;
};

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

// Loads one file with the names given by its tiltproof elements. First everything is checked, and what is
// wrong gathered; only a file in order is read.
class Loader {
 public:
  Loader(const std::filesystem::path& file, const LoadOptions& options, std::vector<std::string>& warnings)
      : file_(file), options_(options), warnings_(warnings), xml_(file) {}

  VehicleModel Load();

 private:
  void LoadSdf();
  void CheckLinks();
  void CheckRoles();
  void CheckServos();
  void CheckHinges();
  void CheckInertia(const RigidBody& body);
  void CheckHover(const VehicleModel& vehicle);
  RigidBody ReadBody(const std::string& link_name) const;
  TiltingThruster ReadThruster(const ThrusterElement& element) const;
  CollisionShape ReadCollision(const RigidBody& base) const;
  // The servo whose joint carries the thruster; null when there is none.
  const ServoElement* ServoOf(const ThrusterElement& element) const;
  // Pose of a link or joint in the base frame.
  Pose3d PoseInBase(const sdf::SemanticPose& pose, const std::string& what, int line) const;

  void Complain(int line, std::string message) { problems_.push_back({file_, line, std::move(message)}); }
  // For the content of the tiltproof elements, which may be in another file.
  void ComplainElement(int line, std::string message) {
    problems_.push_back({elements_.file, line, std::move(message)});
  }
  [[noreturn]] void Fail(int line, const std::string& message) const {
    throw VehicleError(file_, line, message);
  }

  std::filesystem::path file_;
  const LoadOptions& options_;
  std::vector<std::string>& warnings_;
  VehicleXml xml_;
  VehicleElements elements_;
  sdf::Root root_;
  const sdf::Model* model_ = nullptr;
  std::vector<VehicleProblem> problems_;
};

VehicleModel Loader::Load() {
  xml_.Check(problems_);
  LoadSdf();
  CheckLinks();
  elements_ = xml_.ReadElements(options_.mapping, warnings_, problems_);
  CheckRoles();
  CheckServos();
  CheckHinges();
  if (!problems_.empty()) throw VehicleError(problems_, MissingElements(xml_.model(), elements_));
  xml_.WarnUnsupported(elements_, warnings_);

  VehicleModel vehicle;
  vehicle.name = model_->Name();
  vehicle.file = file_;
  vehicle.base = ReadBody(elements_.base_link);
  for (std::size_t side = 0; side < vehicle.thrusters.size(); ++side) {
    vehicle.thrusters[side] = ReadThruster(elements_.thrusters[side]);
    vehicle.thrusters[side].name = side == VehicleModel::kRight ? "right" : "left";
  }
  vehicle.collision = ReadCollision(vehicle.base);
  vehicle.sensor_rate_hz = elements_.sensor_rate_hz;
  vehicle.drag = elements_.drag;
  try {
    vehicle.hover = SolveHover(vehicle);
  } catch (const DesignError& error) {
    Fail(xml_.Line("model", ""), error.what());
  }
  CheckHover(vehicle);
  if (!problems_.empty()) throw VehicleError(problems_);
  return vehicle;
}

// No firmware can hold a vehicle in the air whose actuators are too weak for it.
void Loader::CheckHover(const VehicleModel& vehicle) {
  for (std::size_t side = 0; side < vehicle.thrusters.size(); ++side) {
    const TiltingThruster& thruster = vehicle.thrusters[side];
    const int line = elements_.thrusters[side].line;
    const double force_n = vehicle.hover.input.at(side);
    const double torque_nm = vehicle.hover.input.at(vehicle.thrusters.size() + side);
    const double angle_rad = vehicle.hover.hinge_rad.at(side);
    if (force_n < thruster.force_min_n || force_n > thruster.force_max_n)
      ComplainElement(
          line, fmt::format("the vehicle cannot hover: its {} rotor has to give {:.4g} N, and its limits "
                            "are {:.4g} to {:.4g} N",
                            thruster.name, force_n, thruster.force_min_n, thruster.force_max_n));
    if (std::abs(torque_nm) > thruster.torque_max_nm)
      ComplainElement(
          line, fmt::format("the vehicle cannot hover: its {} servo has to hold {:.4g} N m, and its limit "
                            "is {:.4g} N m",
                            thruster.name, torque_nm, thruster.torque_max_nm));
    if (angle_rad < thruster.angle_min_rad || angle_rad > thruster.angle_max_rad)
      ComplainElement(
          line, fmt::format("the vehicle cannot hover: its {} hinge has to stand at {:.4g} rad, and its "
                            "stops are {:.4g} and {:.4g} rad",
                            thruster.name, angle_rad, thruster.angle_min_rad, thruster.angle_max_rad));
  }
}

void Loader::LoadSdf() {
  sdf::Errors errors;
  std::string trouble;
  {
    const StderrCapture capture;
    try {
      // A name without a folder could resolve to a file of libsdformat's own.
      errors = root_.Load(std::filesystem::absolute(file_).string());
    } catch (const std::exception& error) {
      trouble = error.what();
    }
  }
  const auto is_told = [this](int line) {
    return std::any_of(problems_.begin(), problems_.end(),
                       [line](const VehicleProblem& problem) { return problem.line == line; });
  };
  if (!trouble.empty() && problems_.empty())
    Complain(0, fmt::format("libsdformat cannot read it ({})", trouble));
  // It stops at the first element that it cannot read, and then names all those around it too.
  const auto is_around = [](const sdf::Error& a, const sdf::Error& b) {
    constexpr std::string_view kReading = "Error reading element";
    return a.Message().starts_with(kReading) && b.Message().starts_with(kReading);
  };
  errors.erase(std::unique(errors.begin(), errors.end(), is_around), errors.end());
  for (const bool has_line : {true, false}) {
    // An error without a line follows from another problem, if there is another one.
    if (!has_line && !problems_.empty()) break;
    for (const sdf::Error& error : errors) {
      // Ours names the reason and the line, and can be waived.
      if (error.Code() == sdf::ErrorCode::LINK_INERTIA_INVALID) continue;
      const int line = std::max(error.LineNumber().value_or(0), 0);
      if ((line > 0) == has_line && !is_told(line)) Complain(line, error.Message());
    }
  }
  model_ = root_.Model();
  if (model_ == nullptr && problems_.empty()) Complain(0, "holds no <model>");
  if (model_ != nullptr && model_->Static()) Complain(xml_.Line("model", ""), "a <static> model cannot fly");
}

void Loader::CheckLinks() {
  if (model_ == nullptr) return;
  for (std::uint64_t i = 0; i < model_->LinkCount(); ++i)
    CheckInertia(ReadBody(model_->LinkByIndex(i)->Name()));
}

void Loader::CheckRoles() {
  if (model_ == nullptr) return;
  bool all_exist = elements_.thrusters.size() == 2;
  const auto check_link = [&](const std::string& name, int line, const char* role) {
    const bool exists = !name.empty() && model_->LinkByName(name) != nullptr;
    all_exist = all_exist && exists;
    if (!exists && !name.empty())
      ComplainElement(line, fmt::format("{} link '{}' does not exist in the model", role, name));
  };
  check_link(elements_.base_link, elements_.line, "base");
  for (const ThrusterElement& element : elements_.thrusters) {
    check_link(element.link, element.line, "thruster");
    if (!element.link.empty() && element.link == elements_.base_link)
      ComplainElement(element.line, "the base cannot be a thruster");
  }
  // Where a role is missing or mistyped, a link without one is no news.
  if (!all_exist) return;
  for (std::uint64_t i = 0; i < model_->LinkCount(); ++i) {
    const std::string name = model_->LinkByIndex(i)->Name();
    if (name != elements_.base_link && name != elements_.thrusters[0].link &&
        name != elements_.thrusters[1].link) {
      Complain(xml_.Line("link", name), fmt::format("link '{}' is neither the base nor a thruster", name));
    }
  }
}

void Loader::CheckServos() {
  if (model_ == nullptr) return;
  bool all_exist = elements_.servos.size() == 2;
  for (const ServoElement& servo : elements_.servos) {
    const sdf::Joint* joint = servo.joint.empty() ? nullptr : model_->JointByName(servo.joint);
    all_exist = all_exist && joint != nullptr;
    if (servo.joint.empty()) continue;
    if (joint == nullptr) {
      ComplainElement(servo.line, fmt::format("servo joint '{}' does not exist in the model", servo.joint));
    } else if (const double torque_max_nm =
                   servo.torque_max_nm.value_or(joint->Axis() == nullptr ? 0 : joint->Axis()->Effort());
               !(torque_max_nm > 0 && torque_max_nm < 1e3)) {
      ComplainElement(
          servo.line,
          fmt::format("servo of joint '{}' has no limit: give torque_max_nm here or <effort> there",
                      servo.joint));
    }
  }
  if (!all_exist) return;
  for (const ThrusterElement& element : elements_.thrusters) {
    if (!element.link.empty() && ServoOf(element) == nullptr)
      ComplainElement(element.line,
                      fmt::format("no servo's joint has thruster link '{}' as its child", element.link));
  }
}

void Loader::CheckHinges() {
  if (model_ == nullptr) return;
  for (std::uint64_t i = 0; i < model_->JointCount(); ++i) {
    const sdf::Joint& joint = *model_->JointByIndex(i);
    const std::string what = fmt::format("joint '{}'", joint.Name());
    const int line = xml_.Line("joint", joint.Name());
    if (!elements_.base_link.empty() && joint.ParentLinkName() != elements_.base_link) {
      Complain(line, fmt::format("{}: its parent must be the base '{}', is '{}'", what, elements_.base_link,
                                 joint.ParentLinkName()));
    }
    if (joint.Type() != sdf::JointType::REVOLUTE) {
      Complain(line, what + " must be of type revolute");
      continue;
    }
    if (joint.Axis() == nullptr) {
      Complain(line, what + " has no <axis>");
      continue;
    }
    const double lower_rad = joint.Axis()->Lower(), upper_rad = joint.Axis()->Upper();
    // ODE holds a stop within half a turn only.
    if (!(lower_rad < 0 && upper_rad > 0 && lower_rad > -3.1 && upper_rad < 3.1)) {
      Complain(
          xml_.Line("joint", joint.Name(), "axis"),
          fmt::format("{}: the stops must be <lower> in (-3.1, 0) and <upper> in (0, 3.1) rad, are {} and {}",
                      what, lower_rad, upper_rad));
    }
  }
  if (model_->JointCount() != 2) {
    Complain(xml_.Line("model", ""), fmt::format("a vehicle has two joints; found {}", model_->JointCount()));
  }
}

const ServoElement* Loader::ServoOf(const ThrusterElement& element) const {
  for (const ServoElement& servo : elements_.servos)
    if (model_->JointByName(servo.joint)->ChildLinkName() == element.link) return &servo;
  return nullptr;
}

RigidBody Loader::ReadBody(const std::string& link_name) const {
  const ignition::math::Inertiald& inertial = model_->LinkByName(link_name)->Inertial();
  const ignition::math::MassMatrix3d& mass = inertial.MassMatrix();
  const ignition::math::Vector3d d = mass.DiagonalMoments(), o = mass.OffDiagonalMoments();
  Eigen::Matrix3d inertia;
  inertia << d.X(), o.X(), o.Y(), o.X(), d.Y(), o.Z(), o.Y(), o.Z(), d.Z();
  const Eigen::Matrix3d R_LI = ToEigen(inertial.Pose().Rot());
  return {.link = link_name,
          .mass_kg = mass.Mass(),
          .p_com_m = ToEigen(inertial.Pose().Pos()),
          .inertia_kg_m2 = R_LI * inertia * R_LI.transpose()};
}

void Loader::CheckInertia(const RigidBody& body) {
  if (!(body.mass_kg > 0) || !std::isfinite(body.mass_kg)) {
    Complain(xml_.Line("link", body.link, "mass"),
             fmt::format("link '{}': the mass must be positive, is {} kg", body.link, body.mass_kg));
  }
  const std::string fault = InertiaFault(body.inertia_kg_m2);
  if (fault.empty()) return;
  const int line = xml_.Line("link", body.link, "inertia");
  const std::string message = fmt::format("link '{}': impossible inertia: {}", body.link, fault);
  if (!body.inertia_kg_m2.allFinite()) {
    Complain(line, message);
  } else if (!options_.allow_invalid_inertia) {
    Complain(
        line,
        message + "; to fly it anyway: --allow-invalid-inertia, in a scenario `allow_invalid_inertia: true`");
  } else {
    warnings_.push_back(fmt::format("{}:{}: {}", file_.string(), line, message));
  }
}

Pose3d Loader::PoseInBase(const sdf::SemanticPose& pose, const std::string& what, int line) const {
  Pose3d resolved;
  const sdf::Errors errors = pose.Resolve(resolved, elements_.base_link);
  if (!errors.empty()) Fail(line, fmt::format("{}: {}", what, errors.front().Message()));
  return resolved;
}

TiltingThruster Loader::ReadThruster(const ThrusterElement& element) const {
  TiltingThruster thruster;
  thruster.body = ReadBody(element.link);
  const ServoElement& servo = *ServoOf(element);
  const sdf::Joint& joint = *model_->JointByName(servo.joint);
  const int line = xml_.Line("joint", servo.joint);
  const std::string what = fmt::format("joint '{}'", servo.joint);
  thruster.joint = servo.joint;
  const Pose3d link_pose =
      PoseInBase(model_->LinkByName(element.link)->SemanticPose(), "link '" + element.link + "'", line);
  thruster.p_BT_m = ToEigen(link_pose.Pos());
  thruster.R_BT = ToEigen(link_pose.Rot());
  thruster.p_BH_m = ToEigen(PoseInBase(joint.SemanticPose(), what, line).Pos());
  ignition::math::Vector3d axis;
  const sdf::Errors errors = joint.Axis()->ResolveXyz(axis, elements_.base_link);
  if (!errors.empty()) Fail(line, fmt::format("{}: {}", what, errors.front().Message()));
  thruster.axis_B = ToEigen(axis).normalized();
  thruster.angle_min_rad = joint.Axis()->Lower();
  thruster.angle_max_rad = joint.Axis()->Upper();
  thruster.thrust_axis_T = element.axis;
  thruster.direction = element.direction;
  thruster.drag_ratio_m = element.drag_ratio_m;
  thruster.force_min_n = element.force_min_n;
  thruster.force_max_n = element.force_max_n;
  thruster.torque_max_nm = servo.torque_max_nm.value_or(joint.Axis()->Effort());
  return thruster;
}

CollisionShape Loader::ReadCollision(const RigidBody& base) const {
  CollisionShape shape;
  const sdf::Link& link = *model_->LinkByName(elements_.base_link);
  for (std::uint64_t i = 0; i < link.CollisionCount(); ++i) {
    const sdf::Collision& collision = *link.CollisionByIndex(i);
    const sdf::Geometry& geometry = *collision.Geom();
    if (geometry.Type() == sdf::GeometryType::BOX) {
      shape.kind = CollisionShape::Kind::kBox;
      shape.size_m = ToEigen(geometry.BoxShape()->Size());
    } else if (geometry.Type() == sdf::GeometryType::SPHERE) {
      shape.kind = CollisionShape::Kind::kSphere;
      shape.size_m = {geometry.SphereShape()->Radius(), 0, 0};
    } else if (geometry.Type() == sdf::GeometryType::CYLINDER) {
      shape.kind = CollisionShape::Kind::kCylinder;
      shape.size_m = {geometry.CylinderShape()->Radius(), geometry.CylinderShape()->Length(), 0};
    } else {
      continue;
    }
    const Pose3d pose = PoseInBase(collision.SemanticPose(), "collision '" + collision.Name() + "'",
                                   xml_.Line("link", base.link, "collision"));
    shape.p_BS_m = ToEigen(pose.Pos());
    shape.R_BS = ToEigen(pose.Rot());
    return shape;
  }
  // I_1 = m (b^2 + c^2) / 12 and so on, solved for the edges a, b, c of a box along the principal axes.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(base.inertia_kg_m2);
  const Eigen::Vector3d& moments = principal.eigenvalues();
  constexpr double kEdgeMin_m = 0.01;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double edge_squared = 6 * (moments.sum() - 2 * moments[i]) / base.mass_kg;
    shape.size_m[i] = std::sqrt(std::max(edge_squared, kEdgeMin_m * kEdgeMin_m));
  }
  shape.p_BS_m = base.p_com_m;
  shape.R_BS = principal.eigenvectors();
  if (shape.R_BS.determinant() < 0) shape.R_BS.col(0) *= -1;
  return shape;
}

}  // namespace

VehicleError::VehicleError(std::vector<VehicleProblem> problems, const std::string& advice)
    : std::runtime_error(Text(problems, advice)), problems_(std::move(problems)) {}

VehicleError::VehicleError(std::filesystem::path file, int line, std::string message)
    : VehicleError(std::vector<VehicleProblem>{{std::move(file), line, std::move(message)}}) {}

VehicleSignals VehicleModel::signals() const {
  std::vector<Signal> states, inputs;
  const auto add = [](std::vector<Signal>& to, SignalFrame frame, std::initializer_list<const char*> names) {
    for (const char* each : names) to.push_back(SignalNamed(each, frame));
  };
  // One for each thruster.
  const auto add_each = [this](std::vector<Signal>& to, SignalFrame frame, const char* pattern) {
    for (const TiltingThruster& thruster : thrusters) {
      const std::string spelled = thruster.name == "right"  ? "r"
                                  : thruster.name == "left" ? "l"
                                                            : thruster.name;
      to.push_back(SignalNamed(fmt::format(fmt::runtime(pattern), spelled), frame));
    }
  };
  add(states, SignalFrame::kWorld, {"x_m", "y_m", "z_m"});
  add(states, SignalFrame::kEuler, {"roll_rad", "pitch_rad", "yaw_rad"});
  add_each(states, SignalFrame::kHinge, "alpha_{}_rad");
  add(states, SignalFrame::kWorld, {"vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"});
  add_each(states, SignalFrame::kHinge, "alpha_{}_rad_s");
  add_each(inputs, SignalFrame::kRotor, "f_{}_n");
  add_each(inputs, SignalFrame::kHinge, "tau_{}_nm");
  const std::vector<double> input_min = InputMin(), input_max = InputMax();
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    inputs[i].min = input_min[i];
    inputs[i].max = input_max[i];
  }
  SignalTable table(std::move(states));
  VehicleSignals signals{.states = table, .sensors = table, .inputs = SignalTable(std::move(inputs))};
  for (const TiltingThruster& thruster : thrusters) {
    signals.rotors.push_back(thruster.name);
    signals.joints.push_back(thruster.joint);
  }
  signals.feels_wind = drag != BodyDrag{};
  return signals;
}

std::vector<double> VehicleModel::InputMin() const {
  std::vector<double> row;
  for (const TiltingThruster& thruster : thrusters) row.push_back(thruster.force_min_n);
  for (const TiltingThruster& thruster : thrusters) row.push_back(-thruster.torque_max_nm);
  return row;
}

std::vector<double> VehicleModel::InputMax() const {
  std::vector<double> row;
  for (const TiltingThruster& thruster : thrusters) row.push_back(thruster.force_max_n);
  for (const TiltingThruster& thruster : thrusters) row.push_back(thruster.torque_max_nm);
  return row;
}

VehicleModel LoadVehicle(const std::filesystem::path& file, const LoadOptions& options,
                         std::vector<std::string>& warnings) {
  return Loader(file, options, warnings).Load();
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
