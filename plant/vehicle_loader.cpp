// LoadVehicle: reads a vehicle from an SDF file and its tiltproof elements.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <sdf/Joint.hh>
#include <sdf/JointAxis.hh>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <set>
#include <utility>

#include "plant/collision_shapes.h"
#include "plant/dynamics.h"
#include "plant/sdf_file.h"
#include "plant/sensor_elements.h"
#include "plant/vehicle_mapping.h"
#include "plant/vehicle_model.h"
#include "plant/vehicle_tree.h"
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

// Loads one file with the names given by its tiltproof elements or its motor plugins. First everything is
// checked, and what is wrong gathered; only a file in order is read.
class Loader {
 public:
  Loader(const std::filesystem::path& file, const LoadOptions& options, std::vector<std::string>& warnings)
      : file_(file), options_(options), warnings_(warnings), xml_(file), tree_(xml_.files()) {}

  VehicleModel Load();

 private:
  void CheckInertials();
  void LoadModel();
  void CheckBodies();
  void CheckNames(const VehicleModel& vehicle);
  void CheckInertia(const RigidBody& body, bool is_whole);
  void CheckHover(const VehicleModel& vehicle);
  RigidBody ReadBody(const std::string& link_name) const;
  void AddRotor(const RotorElement& element, VehicleModel& vehicle) const;
  void NameHinges(VehicleModel& vehicle) const;
  // Makes each link that is neither the base nor on a hinge of its own a part of its body.
  void Lump(VehicleModel& vehicle);
  void WarnLumped();
  void WarnWithoutDrag();
  void WarnExchanged(const VehicleModel& vehicle);
  // The place of the hinge among the vehicle's, to which it is added if need be.
  std::size_t HingeOf(const TreeJoint& hinge, VehicleModel& vehicle) const;
  Hinge ReadHinge(const TreeJoint& tree_joint) const;
  std::vector<CollisionShape> ReadShapes(VehicleModel& vehicle) const;
  const sdf::Link& Link(const std::string& name) const { return *model_->LinkByName(InnerName(name)); }
  bool HasInertial(const std::string& link) const {
    return xml_.files().Link(link)->element->FirstChildElement("inertial") != nullptr;
  }
  // Pose of a link or joint in the frame of a link.
  Pose3d PoseIn(const std::string& link, const sdf::SemanticPose& pose, const std::string& what,
                const SdfPlace& place) const;
  // The body in the frame of another link.
  RigidBody BodyIn(const std::string& link, const RigidBody& body) const;

  void Complain(const SdfPlace& place, std::string message) {
    problems_.push_back({place.file, place.line, std::move(message)});
  }
  [[noreturn]] static void Fail(const SdfPlace& place, const std::string& message) {
    throw VehicleError(place.file, place.line, message);
  }

  std::filesystem::path file_;
  const LoadOptions& options_;
  std::vector<std::string>& warnings_;
  VehicleXml xml_;
  VehicleTree tree_;
  VehicleElements elements_;
  sdf::Root root_;
  const sdf::Model* model_ = nullptr;
  std::vector<VehicleProblem> problems_;
};

VehicleModel Loader::Load() {
  xml_.Check(problems_);
  CheckSensorNumbers(xml_.files(), problems_);
  elements_ = ReadElements(xml_.files(), options_.mapping, warnings_, problems_);
  tree_.Assign(elements_, problems_);
  CheckInertials();
  LoadModel();
  CheckBodies();
  if (!problems_.empty()) throw VehicleError(problems_, MissingElements(xml_.files(), tree_, elements_));
  xml_.WarnUnsupported(elements_, tree_.hinges(), warnings_);
  WarnLumped();
  WarnWithoutDrag();

  VehicleModel vehicle;
  vehicle.name = model_->Name();
  vehicle.file = file_;
  vehicle.base = ReadBody(elements_.base_link);
  for (const RotorElement& element : elements_.rotors) AddRotor(element, vehicle);
  Lump(vehicle);
  WarnExchanged(vehicle);
  NameHinges(vehicle);
  CheckNames(vehicle);
  vehicle.shapes = ReadShapes(vehicle);
  vehicle.sensor_rate_hz = elements_.sensor_rate_hz;
  vehicle.sensors = ReadSensors(*model_, xml_.files(), elements_, vehicle, warnings_, problems_);
  vehicle.surroundings = elements_.surroundings;
  vehicle.drag = elements_.drag;
  try {
    vehicle.hover = SolveHover(vehicle);
    CheckHover(vehicle);
  } catch (const DesignError& error) {
    Complain(xml_.Place("model", ""), error.what());
  }
  if (!problems_.empty()) {
    const bool has_no_hover = vehicle.hover.input.empty();
    const VehicleError no_hover(problems_, has_no_hover && !elements_.from_plugins
                                               ? MissingElements(xml_.files(), tree_, elements_)
                                               : "");
    if (!options_.allow_no_hover) throw no_hover;
    vehicle.no_hover = no_hover.what();
  }
  return vehicle;
}

// No firmware can hold a vehicle in the air whose actuators are too weak for it.
void Loader::CheckHover(const VehicleModel& vehicle) {
  for (std::size_t i = 0; i < vehicle.rotors.size(); ++i) {
    const Rotor& rotor = vehicle.rotors[i];
    const double force_n = vehicle.hover.input.at(i);
    if (force_n < rotor.force_min_n || force_n > rotor.force_max_n)
      Complain({elements_.rotors[i].file, elements_.rotors[i].line},
               fmt::format("the vehicle cannot hover: its {} rotor has to give {:.4g} N, and its limits "
                           "are {:.4g} to {:.4g} N",
                           rotor.name, force_n, rotor.force_min_n, rotor.force_max_n));
  }
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i) {
    const Hinge& hinge = vehicle.hinges[i];
    const auto servo = std::find_if(elements_.servos.begin(), elements_.servos.end(),
                                    [&](const ServoElement& each) { return each.joint == hinge.joint; });
    const SdfPlace place{servo->file, servo->line};
    const double torque_nm = vehicle.hover.input.at(vehicle.rotors.size() + i);
    const double angle_rad = vehicle.hover.hinge_rad.at(i);
    if (hinge.servo == ServoMode::kTorque && std::abs(torque_nm) > hinge.torque_max_nm)
      Complain(place,
               fmt::format("the vehicle cannot hover: its {} servo has to hold {:.4g} N m, and its limit "
                           "is {:.4g} N m",
                           hinge.name, torque_nm, hinge.torque_max_nm));
    // So little beyond a stop, the body leans in place of the hinge.
    constexpr double kLean_rad = 1e-4;
    if (angle_rad < hinge.angle_min_rad - kLean_rad || angle_rad > hinge.angle_max_rad + kLean_rad)
      Complain(place,
               fmt::format("the vehicle cannot hover: its {} hinge has to stand at {:.4g} rad, and its "
                           "stops are {:.4g} and {:.4g} rad",
                           hinge.name, angle_rad, hinge.angle_min_rad, hinge.angle_max_rad));
  }
}

// Signals are named after rotors and hinges.
void Loader::CheckNames(const VehicleModel& vehicle) {
  const VehicleSignals signals = vehicle.signals();
  for (const SignalTable* table : {&signals.states, &signals.inputs})
    for (std::size_t i = 0; i < table->size(); ++i)
      if (table->Find((*table)[i].name) != i)
        Complain(
            elements_.file.empty() ? xml_.Place("model", "") : SdfPlace{elements_.file, elements_.line},
            fmt::format("two rotors or hinges have the signal '{}': rename one of them", (*table)[i].name));
  if (!problems_.empty()) throw VehicleError(problems_);
}

void Loader::CheckInertials() {
  // A link that is lumped may be a frame without mass.
  xml_.CheckInertials(
      [this](const std::string& link) {
        if (link == elements_.base_link || tree_.HingeOf(link) != nullptr) return false;
        for (const RotorElement& rotor : elements_.rotors)
          if (rotor.link == link) return false;
        for (const ServoElement& servo : elements_.servos)
          if (const TreeJoint* joint = tree_.Joint(servo.joint); joint != nullptr && joint->child == link)
            return false;
        return true;
      },
      problems_);
}

void Loader::LoadModel() {
  LoadSdf(xml_.files(), tree_.hinges(), root_, problems_);
  model_ = root_.Model();
  if (model_ == nullptr && problems_.empty()) Complain({file_, 0}, "holds no <model>");
}

void Loader::CheckBodies() {
  if (model_ == nullptr) return;
  for (const SdfPart& link : xml_.files().links())
    if (HasInertial(link.name) && model_->LinkByName(InnerName(link.name)) != nullptr)
      CheckInertia(ReadBody(link.name), !tree_.IsRigid(link.name));
}

RigidBody Loader::ReadBody(const std::string& link_name) const {
  const ignition::math::Inertiald& inertial = Link(link_name).Inertial();
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

// A part of another body needs no inertia that is possible by itself: only the sum moves.
void Loader::CheckInertia(const RigidBody& body, bool is_whole) {
  if (!(body.mass_kg > 0) || !std::isfinite(body.mass_kg)) {
    Complain(xml_.Place("link", body.link, "mass"),
             fmt::format("link '{}': the mass must be positive, is {} kg", body.link, body.mass_kg));
  }
  const std::string fault = InertiaFault(body.inertia_kg_m2);
  if (fault.empty()) return;
  const SdfPlace place = xml_.Place("link", body.link, "inertia");
  const std::string message = fmt::format("link '{}': impossible inertia: {}", body.link, fault);
  if (!body.inertia_kg_m2.allFinite()) {
    Complain(place, message);
  } else if (is_whole && !options_.allow_invalid_inertia) {
    Complain(
        place,
        message + "; to fly it anyway: --allow-invalid-inertia, in a scenario `allow_invalid_inertia: true`");
  } else {
    warnings_.push_back(fmt::format("{}:{}: {}", place.file.string(), place.line, message));
  }
}

// The firmware for two rotors rolls the wrong way with a left rotor that is called right.
void Loader::WarnExchanged(const VehicleModel& vehicle) {
  const std::vector<Rotor>& rotors = vehicle.rotors;
  if (rotors.size() != 2 || rotors[0].name != "right") return;
  const auto y_m = [&](const Rotor& rotor) {
    if (!rotor.hinge) return rotor.p_LR_m.y();
    const Hinge& hinge = vehicle.hinges[*rotor.hinge];
    return (hinge.p_BT_m + hinge.R_BT * rotor.p_LR_m).y();
  };
  if (y_m(rotors[0]) <= y_m(rotors[1])) return;
  warnings_.push_back(fmt::format(
      "{}:{}: rotor 'right' is at y = {:.3g} m, to the left of rotor 'left' at {:.3g} m: exchange the names",
      elements_.rotors[0].file.string(), elements_.rotors[0].line, y_m(rotors[0]), y_m(rotors[1])));
}

Pose3d Loader::PoseIn(const std::string& link, const sdf::SemanticPose& pose, const std::string& what,
                      const SdfPlace& place) const {
  Pose3d resolved;
  const sdf::Errors errors = pose.Resolve(resolved, InnerName(link));
  if (!errors.empty()) Fail(place, fmt::format("{}: {}", what, OuterName(errors.front().Message())));
  return resolved;
}

RigidBody Loader::BodyIn(const std::string& link, const RigidBody& body) const {
  const Pose3d pose =
      PoseIn(link, Link(body.link).SemanticPose(), "link '" + body.link + "'", xml_.Place("link", body.link));
  const Eigen::Matrix3d turn = ToEigen(pose.Rot());
  return {.link = body.link,
          .mass_kg = body.mass_kg,
          .p_com_m = ToEigen(pose.Pos()) + turn * body.p_com_m,
          .inertia_kg_m2 = turn * body.inertia_kg_m2 * turn.transpose()};
}

void Loader::AddRotor(const RotorElement& element, VehicleModel& vehicle) const {
  const RigidBody own = ReadBody(element.link);
  Rotor rotor{.name = element.name,
              .hinge = {},
              .p_LR_m = own.p_com_m,
              .thrust_axis_L = element.axis,
              .direction = element.direction,
              .drag_ratio_m = element.drag_ratio_m,
              .force_min_n = element.force_min_n,
              .force_max_n = element.force_max_n,
              .time_constant_up_s = element.time_constant_up_s,
              .time_constant_down_s = element.time_constant_down_s};
  const std::string& carrier = tree_.BodyOf(element.link);
  if (const TreeJoint* hinge = tree_.HingeOf(carrier)) rotor.hinge = HingeOf(*hinge, vehicle);
  if (carrier != element.link) {
    const Pose3d pose = PoseIn(carrier, Link(element.link).SemanticPose(), "link '" + element.link + "'",
                               xml_.Place("link", element.link));
    rotor.p_LR_m = BodyIn(carrier, own).p_com_m;
    rotor.thrust_axis_L = ToEigen(pose.Rot()) * element.axis;
  }
  vehicle.rotors.push_back(std::move(rotor));
}

void Loader::Lump(VehicleModel& vehicle) {
  std::set<std::string> changed;
  for (const SdfPart& part : xml_.files().links()) {
    if (!tree_.IsRigid(part.name) || !HasInertial(part.name)) continue;
    const std::string& carrier = tree_.BodyOf(part.name);
    const TreeJoint* hinge = tree_.HingeOf(carrier);
    AddTo(hinge == nullptr ? vehicle.base : vehicle.hinges[HingeOf(*hinge, vehicle)].body,
          BodyIn(carrier, ReadBody(part.name)));
    changed.insert(carrier);
  }
  if (changed.contains(vehicle.base.link)) CheckInertia(vehicle.base, true);
  for (const Hinge& hinge : vehicle.hinges)
    if (changed.contains(hinge.body.link)) CheckInertia(hinge.body, true);
}

void Loader::WarnWithoutDrag() {
  for (const RotorElement& rotor : elements_.rotors)
    if (!rotor.states_drag)
      warnings_.push_back(
          fmt::format("{}:{}: rotor '{}': without drag_ratio_m its propeller exerts no drag torque",
                      rotor.file.string(), rotor.line, rotor.name));
}

void Loader::WarnLumped() {
  if (tree_.lumped().empty()) return;
  std::string names, massless;
  double mass_kg = 0;
  for (const std::string& link : tree_.lumped()) {
    names += (names.empty() ? "" : ", ") + link;
    if (HasInertial(link))
      mass_kg += ReadBody(link).mass_kg;
    else
      massless += (massless.empty() ? "" : ", ") + link;
  }
  const std::size_t count = tree_.lumped().size();
  const SdfPlace place = xml_.Place("model", "");
  warnings_.push_back(fmt::format(
      "{}:{}: {} that {} no rotor {} fixed to what carries {} ({:.6g} kg): {}{}", place.file.string(),
      place.line, count == 1 ? "1 link" : fmt::format("{} links", count), count == 1 ? "carries" : "carry",
      count == 1 ? "is" : "are", count == 1 ? "it" : "them", mass_kg, names,
      massless.empty() ? "" : "; without <inertial>, so without mass: " + massless));
}

// A hinge has the name of its only rotor, else that of its joint.
void Loader::NameHinges(VehicleModel& vehicle) const {
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i) {
    const auto is_carried = [i](const Rotor& rotor) { return rotor.hinge == i; };
    const auto carried = std::count_if(vehicle.rotors.begin(), vehicle.rotors.end(), is_carried);
    const auto first = std::find_if(vehicle.rotors.begin(), vehicle.rotors.end(), is_carried);
    vehicle.hinges[i].name = carried == 1 ? first->name : PartName(vehicle.hinges[i].joint);
  }
}

std::size_t Loader::HingeOf(const TreeJoint& hinge, VehicleModel& vehicle) const {
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i)
    if (vehicle.hinges[i].joint == hinge.name()) return i;
  vehicle.hinges.push_back(ReadHinge(hinge));
  return vehicle.hinges.size() - 1;
}

Hinge Loader::ReadHinge(const TreeJoint& tree_joint) const {
  const sdf::Joint& joint = *model_->JointByName(InnerName(tree_joint.name()));
  const SdfPlace place = xml_.Place("joint", tree_joint.name());
  const std::string what = fmt::format("joint '{}'", tree_joint.name());
  Hinge hinge;
  hinge.joint = tree_joint.name();
  hinge.body = ReadBody(tree_joint.child);
  const Pose3d link_pose = PoseIn(elements_.base_link, Link(tree_joint.child).SemanticPose(),
                                  "link '" + tree_joint.child + "'", place);
  hinge.p_BT_m = ToEigen(link_pose.Pos());
  hinge.R_BT = ToEigen(link_pose.Rot());
  hinge.p_BH_m = ToEigen(PoseIn(elements_.base_link, joint.SemanticPose(), what, place).Pos());
  ignition::math::Vector3d axis;
  const sdf::Errors errors = joint.Axis()->ResolveXyz(axis, InnerName(elements_.base_link));
  if (!errors.empty()) Fail(place, fmt::format("{}: {}", what, OuterName(errors.front().Message())));
  hinge.axis_B = ToEigen(axis).normalized();
  hinge.angle_min_rad = joint.Axis()->Lower();
  hinge.angle_max_rad = joint.Axis()->Upper();
  const ServoElement& servo =
      *std::find_if(elements_.servos.begin(), elements_.servos.end(),
                    [&](const ServoElement& each) { return each.joint == hinge.joint; });
  hinge.servo = servo.mode;
  hinge.torque_max_nm = servo.torque_max_nm.value_or(tree_joint.effort);
  if (servo.mode == ServoMode::kPosition)
    hinge.speed_max_rad_s = servo.speed_max_rad_s.value_or(tree_joint.velocity);
  hinge.time_constant_s = servo.time_constant_s;
  return hinge;
}

std::vector<CollisionShape> Loader::ReadShapes(VehicleModel& vehicle) const {
  std::vector<CollisionShape> shapes;
  const auto add = [&](const std::string& name) {
    CollisionShape as;
    as.link = name;
    const std::string& body = tree_.BodyOf(name);
    if (const TreeJoint* hinge = tree_.HingeOf(body)) as.hinge = HingeOf(*hinge, vehicle);
    const std::string problem = AddShapes(Link(name), InnerName(body), as, shapes);
    if (!problem.empty()) Fail(xml_.Place("link", name, "collision"), OuterName(problem));
  };
  // The main body's own come first: they stand for it in pictures.
  add(elements_.base_link);
  for (const SdfPart& part : xml_.files().links())
    if (part.name != elements_.base_link) add(part.name);
  if (shapes.empty()) shapes.push_back(InertiaBox(vehicle.base));
  return shapes;
}

}  // namespace

VehicleModel LoadVehicle(const std::filesystem::path& file, const LoadOptions& options,
                         std::vector<std::string>& warnings) {
  return Loader(file, options, warnings).Load();
}

std::vector<std::filesystem::path> IncludedFiles(const std::filesystem::path& file) {
  return SdfFiles(file).included();
}

}  // namespace tiltproof::plant
