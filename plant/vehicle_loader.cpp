// LoadVehicle: reads a vehicle from an SDF file and its tiltproof elements.
#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
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
#include <set>
#include <utility>

#include "plant/dynamics.h"
#include "plant/missing_elements.h"
#include "plant/sdf_file.h"
#include "plant/sensor_elements.h"
#include "plant/vehicle_model.h"
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

// Makes `part` a part of the other body; both in the same frame.
void AddTo(RigidBody& whole, const RigidBody& part) {
  const double mass_kg = whole.mass_kg + part.mass_kg;
  const Eigen::Vector3d com_m = (whole.mass_kg * whole.p_com_m + part.mass_kg * part.p_com_m) / mass_kg;
  const auto about_com = [&](const RigidBody& body) -> Eigen::Matrix3d {
    const Eigen::Vector3d d = body.p_com_m - com_m;
    return body.inertia_kg_m2 +
           body.mass_kg * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
  };
  whole.inertia_kg_m2 = about_com(whole) + about_com(part);
  whole.p_com_m = com_m;
  whole.mass_kg = mass_kg;
}

// Loads one file with the names given by its tiltproof elements. First everything is checked, and what is
// wrong gathered; only a file in order is read.
class Loader {
 public:
  Loader(const std::filesystem::path& file, const LoadOptions& options, std::vector<std::string>& warnings)
      : file_(file), options_(options), warnings_(warnings), xml_(file) {}

  VehicleModel Load();

 private:
  void LoadModel();
  void CheckLinks();
  void CheckRoles();
  void CheckServos();
  void CheckJoints();
  void CheckTree();
  void CheckNames(const VehicleModel& vehicle);
  void CheckInertia(const RigidBody& body);
  void CheckHover(const VehicleModel& vehicle);
  RigidBody ReadBody(const std::string& link_name) const;
  void AddRotor(const ThrusterElement& element, VehicleModel& vehicle) const;
  // The place of the joint's hinge among the vehicle's, to which it is added if need be.
  std::size_t HingeOf(const sdf::Joint& joint, VehicleModel& vehicle) const;
  Hinge ReadHinge(const sdf::Joint& joint) const;
  CollisionShape ReadCollision(const RigidBody& base) const;
  // The joints of which the link is the child.
  std::vector<const sdf::Joint*> JointsTo(const std::string& link) const;
  // Null when there is none.
  const ServoElement* ServoOf(const std::string& joint) const;
  // Pose of a link or joint in the frame of a link.
  Pose3d PoseIn(const std::string& link, const sdf::SemanticPose& pose, const std::string& what,
                int line) const;

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
  CheckSensorNumbers(file_, xml_.model(), problems_);
  LoadModel();
  CheckLinks();
  elements_ = xml_.ReadElements(options_.mapping, warnings_, problems_);
  CheckRoles();
  CheckServos();
  CheckJoints();
  // Each part is in order: now the whole.
  if (problems_.empty()) CheckTree();
  if (!problems_.empty()) throw VehicleError(problems_, MissingElements(xml_.model(), elements_));
  xml_.WarnUnsupported(elements_, warnings_);

  VehicleModel vehicle;
  vehicle.name = model_->Name();
  vehicle.file = file_;
  vehicle.base = ReadBody(elements_.base_link);
  for (const ThrusterElement& element : elements_.thrusters) AddRotor(element, vehicle);
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i) {
    const auto carried = std::count_if(vehicle.rotors.begin(), vehicle.rotors.end(),
                                       [i](const Rotor& rotor) { return rotor.hinge == i; });
    const auto first = std::find_if(vehicle.rotors.begin(), vehicle.rotors.end(),
                                    [i](const Rotor& rotor) { return rotor.hinge == i; });
    vehicle.hinges[i].name = carried == 1 ? first->name : vehicle.hinges[i].joint;
  }
  CheckNames(vehicle);
  vehicle.collision = ReadCollision(vehicle.base);
  vehicle.sensor_rate_hz = elements_.sensor_rate_hz;
  vehicle.sensors = ReadSensors(*model_, elements_, vehicle, warnings_, problems_);
  vehicle.surroundings = elements_.surroundings;
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
  for (std::size_t i = 0; i < vehicle.rotors.size(); ++i) {
    const Rotor& rotor = vehicle.rotors[i];
    const double force_n = vehicle.hover.input.at(i);
    if (force_n < rotor.force_min_n || force_n > rotor.force_max_n)
      ComplainElement(
          elements_.thrusters[i].line,
          fmt::format("the vehicle cannot hover: its {} rotor has to give {:.4g} N, and its limits "
                      "are {:.4g} to {:.4g} N",
                      rotor.name, force_n, rotor.force_min_n, rotor.force_max_n));
  }
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i) {
    const Hinge& hinge = vehicle.hinges[i];
    const int line = ServoOf(hinge.joint)->line;
    const double torque_nm = vehicle.hover.input.at(vehicle.rotors.size() + i);
    const double angle_rad = vehicle.hover.hinge_rad.at(i);
    if (std::abs(torque_nm) > hinge.torque_max_nm)
      ComplainElement(
          line, fmt::format("the vehicle cannot hover: its {} servo has to hold {:.4g} N m, and its limit "
                            "is {:.4g} N m",
                            hinge.name, torque_nm, hinge.torque_max_nm));
    if (angle_rad < hinge.angle_min_rad || angle_rad > hinge.angle_max_rad)
      ComplainElement(
          line, fmt::format("the vehicle cannot hover: its {} hinge has to stand at {:.4g} rad, and its "
                            "stops are {:.4g} and {:.4g} rad",
                            hinge.name, angle_rad, hinge.angle_min_rad, hinge.angle_max_rad));
  }
}

// Signals are named after rotors and hinges.
void Loader::CheckNames(const VehicleModel& vehicle) {
  for (const Hinge& hinge : vehicle.hinges)
    if (!IsPartName(hinge.name))
      Complain(xml_.Line("joint", hinge.joint),
               fmt::format("joint '{}' carries several rotors, so signals have its name: it must be "
                           "letters, digits and '_', and begin with a letter",
                           hinge.joint));
  const VehicleSignals signals = vehicle.signals();
  for (const SignalTable* table : {&signals.states, &signals.inputs})
    for (std::size_t i = 0; i < table->size(); ++i)
      if (table->Find((*table)[i].name) != i)
        ComplainElement(
            elements_.line,
            fmt::format("two rotors or hinges have the signal '{}': rename one of them", (*table)[i].name));
  if (!problems_.empty()) throw VehicleError(problems_);
}

void Loader::LoadModel() {
  LoadSdf(file_, root_, problems_);
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
  bool all_exist = !elements_.thrusters.empty();
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
  // Those that carry a thruster, too.
  std::set<std::string> used = {elements_.base_link};
  for (const ThrusterElement& element : elements_.thrusters) {
    used.insert(element.link);
    for (const sdf::Joint* joint : JointsTo(element.link)) used.insert(joint->ParentLinkName());
  }
  for (std::uint64_t i = 0; i < model_->LinkCount(); ++i) {
    const std::string name = model_->LinkByIndex(i)->Name();
    if (!used.contains(name))
      Complain(xml_.Line("link", name), fmt::format("link '{}' is neither the base nor a thruster", name));
  }
}

void Loader::CheckServos() {
  if (model_ == nullptr) return;
  for (const ServoElement& servo : elements_.servos) {
    const sdf::Joint* joint = servo.joint.empty() ? nullptr : model_->JointByName(servo.joint);
    if (servo.joint.empty()) continue;
    if (joint == nullptr) {
      ComplainElement(servo.line, fmt::format("servo joint '{}' does not exist in the model", servo.joint));
    } else if (joint->Type() == sdf::JointType::FIXED) {
      ComplainElement(servo.line, fmt::format("servo joint '{}' is fixed", servo.joint));
    } else if (const double torque_max_nm =
                   servo.torque_max_nm.value_or(joint->Axis() == nullptr ? 0 : joint->Axis()->Effort());
               !(torque_max_nm > 0 && torque_max_nm < 1e3)) {
      ComplainElement(
          servo.line,
          fmt::format("servo of joint '{}' has no limit: give torque_max_nm here or <effort> there",
                      servo.joint));
    }
  }
}

void Loader::CheckJoints() {
  if (model_ == nullptr) return;
  for (std::uint64_t i = 0; i < model_->JointCount(); ++i) {
    const sdf::Joint& joint = *model_->JointByIndex(i);
    const std::string what = fmt::format("joint '{}'", joint.Name());
    const int line = xml_.Line("joint", joint.Name());
    // A thruster may be fixed to a hinge's link as well: CheckTree().
    if (joint.Type() == sdf::JointType::FIXED) continue;
    if (!elements_.base_link.empty() && joint.ParentLinkName() != elements_.base_link) {
      Complain(line, fmt::format("{}: its parent must be the base '{}', is '{}'", what, elements_.base_link,
                                 joint.ParentLinkName()));
    }
    if (joint.Type() != sdf::JointType::REVOLUTE) {
      Complain(line, what + " must be of type revolute, or of type fixed");
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
}

// Each link but the base hangs on one joint: on a hinge with a servo, or fixed to the base or to a hinge's link.
void Loader::CheckTree() {
  for (std::uint64_t i = 0; i < model_->LinkCount(); ++i) {
    const std::string name = model_->LinkByIndex(i)->Name();
    const std::vector<const sdf::Joint*> joints = JointsTo(name);
    const int line = xml_.Line("link", name);
    if (name == elements_.base_link) {
      if (!joints.empty())
        Complain(line, fmt::format("the base '{}' is the child of joint '{}'", name, joints[0]->Name()));
    } else if (joints.size() != 1) {
      Complain(line,
               fmt::format("link '{}' must be the child of one joint, is that of {}", name, joints.size()));
    } else if (joints[0]->Type() == sdf::JointType::FIXED) {
      const std::string& parent = joints[0]->ParentLinkName();
      const std::vector<const sdf::Joint*> above = JointsTo(parent);
      if (parent != elements_.base_link && (above.empty() || above[0]->Type() != sdf::JointType::REVOLUTE))
        Complain(xml_.Line("joint", joints[0]->Name()),
                 fmt::format("joint '{}': its parent must be the base '{}' or on a hinge, is '{}'",
                             joints[0]->Name(), elements_.base_link, parent));
    } else if (ServoOf(joints[0]->Name()) == nullptr) {
      const auto element = std::find_if(elements_.thrusters.begin(), elements_.thrusters.end(),
                                        [&](const ThrusterElement& each) { return each.link == name; });
      ComplainElement(element == elements_.thrusters.end() ? elements_.line : element->line,
                      fmt::format("no servo's joint has {} '{}' as its child",
                                  element == elements_.thrusters.end() ? "link" : "thruster link", name));
    }
  }
  for (const ServoElement& servo : elements_.servos)
    if (const ServoElement* first = ServoOf(servo.joint); first != &servo)
      ComplainElement(servo.line, fmt::format("a second servo of joint '{}'", servo.joint));
}

std::vector<const sdf::Joint*> Loader::JointsTo(const std::string& link) const {
  std::vector<const sdf::Joint*> joints;
  for (std::uint64_t i = 0; i < model_->JointCount(); ++i)
    if (const sdf::Joint* joint = model_->JointByIndex(i); joint->ChildLinkName() == link)
      joints.push_back(joint);
  return joints;
}

const ServoElement* Loader::ServoOf(const std::string& joint) const {
  for (const ServoElement& servo : elements_.servos)
    if (servo.joint == joint) return &servo;
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

Pose3d Loader::PoseIn(const std::string& link, const sdf::SemanticPose& pose, const std::string& what,
                      int line) const {
  Pose3d resolved;
  const sdf::Errors errors = pose.Resolve(resolved, link);
  if (!errors.empty()) Fail(line, fmt::format("{}: {}", what, errors.front().Message()));
  return resolved;
}

void Loader::AddRotor(const ThrusterElement& element, VehicleModel& vehicle) const {
  const sdf::Joint& joint = *JointsTo(element.link).front();
  const RigidBody own = ReadBody(element.link);
  Rotor rotor{.name = element.name,
              .hinge = {},
              .p_LR_m = own.p_com_m,
              .thrust_axis_L = element.axis,
              .direction = element.direction,
              .drag_ratio_m = element.drag_ratio_m,
              .force_min_n = element.force_min_n,
              .force_max_n = element.force_max_n};
  if (joint.Type() == sdf::JointType::REVOLUTE) {
    rotor.hinge = HingeOf(joint, vehicle);
  } else {
    // Its body becomes a part of the one that carries it.
    const std::string& parent = joint.ParentLinkName();
    if (parent != elements_.base_link) rotor.hinge = HingeOf(*JointsTo(parent).front(), vehicle);
    const Pose3d pose = PoseIn(parent, model_->LinkByName(element.link)->SemanticPose(),
                               "link '" + element.link + "'", xml_.Line("link", element.link));
    const Eigen::Matrix3d turn = ToEigen(pose.Rot());
    rotor.p_LR_m = ToEigen(pose.Pos()) + turn * own.p_com_m;
    rotor.thrust_axis_L = turn * element.axis;
    AddTo(rotor.hinge ? vehicle.hinges[*rotor.hinge].body : vehicle.base,
          {.link = own.link,
           .mass_kg = own.mass_kg,
           .p_com_m = rotor.p_LR_m,
           .inertia_kg_m2 = turn * own.inertia_kg_m2 * turn.transpose()});
  }
  vehicle.rotors.push_back(std::move(rotor));
}

std::size_t Loader::HingeOf(const sdf::Joint& joint, VehicleModel& vehicle) const {
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i)
    if (vehicle.hinges[i].joint == joint.Name()) return i;
  vehicle.hinges.push_back(ReadHinge(joint));
  return vehicle.hinges.size() - 1;
}

Hinge Loader::ReadHinge(const sdf::Joint& joint) const {
  const std::string& link = joint.ChildLinkName();
  const int line = xml_.Line("joint", joint.Name());
  const std::string what = fmt::format("joint '{}'", joint.Name());
  Hinge hinge;
  hinge.joint = joint.Name();
  hinge.body = ReadBody(link);
  const Pose3d link_pose =
      PoseIn(elements_.base_link, model_->LinkByName(link)->SemanticPose(), "link '" + link + "'", line);
  hinge.p_BT_m = ToEigen(link_pose.Pos());
  hinge.R_BT = ToEigen(link_pose.Rot());
  hinge.p_BH_m = ToEigen(PoseIn(elements_.base_link, joint.SemanticPose(), what, line).Pos());
  ignition::math::Vector3d axis;
  const sdf::Errors errors = joint.Axis()->ResolveXyz(axis, elements_.base_link);
  if (!errors.empty()) Fail(line, fmt::format("{}: {}", what, errors.front().Message()));
  hinge.axis_B = ToEigen(axis).normalized();
  hinge.angle_min_rad = joint.Axis()->Lower();
  hinge.angle_max_rad = joint.Axis()->Upper();
  hinge.torque_max_nm = ServoOf(joint.Name())->torque_max_nm.value_or(joint.Axis()->Effort());
  return hinge;
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
    const Pose3d pose =
        PoseIn(elements_.base_link, collision.SemanticPose(), "collision '" + collision.Name() + "'",
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

VehicleModel LoadVehicle(const std::filesystem::path& file, const LoadOptions& options,
                         std::vector<std::string>& warnings) {
  return Loader(file, options, warnings).Load();
}

}  // namespace tiltproof::plant
