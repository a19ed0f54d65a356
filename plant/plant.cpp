#include "plant/plant.h"

#include <fmt/core.h>
#include <ode/ode.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <numbers>

namespace tiltproof::plant {
namespace {

static_assert(sizeof(dReal) == sizeof(double), "needs ODE built in double precision");

using Eigen::Matrix3d;
using Eigen::Vector3d;

// ODE calls its handlers where it would else print and abort. They must not return to it.
[[noreturn]] void ThrowOdeError(int number, const char* format, std::va_list arguments) {
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw PlantError(fmt::format("ODE error {}: {}", number, text.data()));
}

// Its warnings (a singular constraint solved anyway) would go to stderr in the middle of a flight; what comes
// of them shows in the state.
void IgnoreOdeMessage(int, const char*, std::va_list) {}

// ODE's library state: once a process, its scratch data once a thread.
void InitialiseOde() {
  struct Library {
    Library() {
      dInitODE2(0);
      dSetErrorHandler(ThrowOdeError);
      dSetDebugHandler(ThrowOdeError);
      dSetMessageHandler(IgnoreOdeMessage);
    }
    ~Library() { dCloseODE(); }
    Library(const Library&) = delete;
    Library& operator=(const Library&) = delete;
  };
  static const Library library;
  thread_local const bool has_thread_data = dAllocateODEDataForThread(dAllocateMaskAll) != 0;
  if (!has_thread_data) throw PlantError("ODE cannot allocate its data");
}

Vector3d ToVector(const dReal* v) { return {v[0], v[1], v[2]}; }

Matrix3d ToMatrix(const dReal* r) {
  Matrix3d matrix;
  matrix << r[0], r[1], r[2], r[4], r[5], r[6], r[8], r[9], r[10];
  return matrix;
}

void SetRotation(dBodyID body, const Matrix3d& r) {
  const dMatrix3 rows = {r(0, 0), r(0, 1), r(0, 2), 0,       r(1, 0), r(1, 1),
                         r(1, 2), 0,       r(2, 0), r(2, 1), r(2, 2), 0};
  dBodySetRotation(body, rows);
}

Matrix3d FromEuler(double roll, double pitch, double yaw) {
  return (Eigen::AngleAxisd(yaw, Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Vector3d::UnitX()))
      .toRotationMatrix();
}

constexpr int kContactsMax = 8;

}  // namespace

struct Plant::World {
  // A body of ours, and ODE's at its centre of mass.
  struct Body {
    dBodyID id = nullptr;
    Vector3d p_com_m;
    Matrix3d inertia_kg_m2;
    double mass_kg = 0;

    Vector3d Com() const { return ToVector(dBodyGetPosition(id)); }
    Matrix3d Attitude() const { return ToMatrix(dBodyGetRotation(id)); }
    Vector3d Velocity() const { return ToVector(dBodyGetLinearVel(id)); }
    Vector3d AngularVelocity() const { return ToVector(dBodyGetAngularVel(id)); }
  };

  World(const VehicleModel& vehicle, const PlantOptions& plant_options);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  void Create();
  void Destroy();
  Body CreateBody(const RigidBody& body, const Vector3d& p_BL, const Matrix3d& R_BL) const;
  void CreateShape();

  void Place(const SensorsTruth& state);
  void StepOnce(const ActuatorsTruth& input);
  SensorsTruth Observe() const;  // world rates
  void FindContacts();
  void Sample();
  void CheckEvent();
  void SetEvent(FlightEvent kind, std::string text);

  VehicleModel model;
  PlantOptions options;
  ActuatorsTruth input_min, input_max;
  double step_s = 0;

  dWorldID world = nullptr;
  dThreadingImplementationID threading = nullptr;  // runs the step in the caller's thread
  bool broken = false;                             // an error left the step in the middle
  dJointGroupID contact_joints = nullptr;
  dGeomID ground = nullptr, shape = nullptr;
  double shape_radius_m = 0;  // no point of the shape is farther from its centre
  Body base;
  std::array<Body, 2> thrusters;
  std::array<dJointID, 2> hinges{};

  std::array<dContactGeom, kContactsMax> contacts{};
  int contact_count = 0;

  TimeNs time_ns = 0, sensor_period_ns = 0, next_sample_ns = 0;
  SensorsTruth sample;
  FlightEvent event = FlightEvent::kNone;
  std::string event_text;
};

Plant::World::World(const VehicleModel& vehicle, const PlantOptions& plant_options)
    : model(vehicle), options(plant_options), input_min(model.InputMin()), input_max(model.InputMax()) {
  if (options.step_ns <= 0) throw PlantError("the step must be positive");
  step_s = ToSeconds(options.step_ns);
  if (model.sensor_rate_hz > 0) sensor_period_ns = FromSeconds(1 / model.sensor_rate_hz);
  InitialiseOde();
  try {
    Create();
  } catch (...) {
    Destroy();
    throw;
  }
}

Plant::World::~World() { Destroy(); }

void Plant::World::Create() {
  world = dWorldCreate();
  // The default is shared by all worlds of the process; an error in one must not touch another.
  threading = dThreadingAllocateSelfThreadedImplementation();
  dWorldSetStepThreadingImplementation(world, dThreadingImplementationGetFunctions(threading), threading);
  dWorldSetGravity(world, 0, 0, -options.gravity_m_s2);
  base = CreateBody(model.base, Vector3d::Zero(), Matrix3d::Identity());
  for (std::size_t side = 0; side < thrusters.size(); ++side) {
    const TiltingThruster& thruster = model.thrusters[side];
    thrusters[side] = CreateBody(thruster.body, thruster.p_BT_m, thruster.R_BT);
    // ODE takes the bodies' present pose for the hinge angle 0.
    const dJointID hinge = hinges[side] = dJointCreateHinge(world, nullptr);
    dJointAttach(hinge, thrusters[side].id, base.id);
    dJointSetHingeAnchor(hinge, thruster.p_BH_m.x(), thruster.p_BH_m.y(), thruster.p_BH_m.z());
    dJointSetHingeAxis(hinge, thruster.axis_B.x(), thruster.axis_B.y(), thruster.axis_B.z());
    dJointSetHingeParam(hinge, dParamLoStop, thruster.angle_min_rad);
    dJointSetHingeParam(hinge, dParamHiStop, thruster.angle_max_rad);
    dJointSetHingeParam(hinge, dParamBounce, 0);
  }
  contact_joints = dJointGroupCreate(0);
  ground = dCreatePlane(nullptr, 0, 0, 1, 0);
  CreateShape();
}

void Plant::World::Destroy() {
  if (shape != nullptr) dGeomDestroy(shape);
  if (ground != nullptr) dGeomDestroy(ground);
  if (contact_joints != nullptr) dJointGroupDestroy(contact_joints);
  if (world != nullptr) dWorldDestroy(world);
  // ODE insists that no job is left when the threading goes; after an error some are, so it stays: some
  // kilobytes.
  if (threading != nullptr && !broken) dThreadingFreeImplementation(threading);
  shape = ground = nullptr;
  contact_joints = nullptr;
  world = nullptr;
  threading = nullptr;
  broken = false;
}

Plant::World::Body Plant::World::CreateBody(const RigidBody& body, const Vector3d& p_BL,
                                            const Matrix3d& R_BL) const {
  const Matrix3d& i = body.inertia_kg_m2;
  dMass mass;
  dMassSetParameters(&mass, body.mass_kg, 0, 0, 0, i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2));
  // ODE checks this itself in debug builds only.
  if (dMassCheck(&mass) == 0) {
    throw PlantError(fmt::format("link '{}': ODE cannot integrate this mass and inertia", body.link));
  }
  const dBodyID id = dBodyCreate(world);
  dBodySetMass(id, &mass);
  dBodySetGyroscopicMode(id, 1);
  dBodySetAutoDisableFlag(id, 0);
  const Vector3d com = p_BL + R_BL * body.p_com_m;
  dBodySetPosition(id, com.x(), com.y(), com.z());
  SetRotation(id, R_BL);
  return {.id = id, .p_com_m = body.p_com_m, .inertia_kg_m2 = i, .mass_kg = body.mass_kg};
}

void Plant::World::CreateShape() {
  const CollisionShape& from = model.collision;
  const Vector3d& size = from.size_m;
  switch (from.kind) {
    case CollisionShape::Kind::kBox:
      shape = dCreateBox(nullptr, size.x(), size.y(), size.z());
      break;
    case CollisionShape::Kind::kSphere:
      shape = dCreateSphere(nullptr, size.x());
      break;
    case CollisionShape::Kind::kCylinder:
      shape = dCreateCylinder(nullptr, size.x(), size.y());
      break;
  }
  const Vector3d p_CS = from.p_BS_m - model.base.p_com_m;
  const Matrix3d& r = from.R_BS;
  const dMatrix3 rows = {r(0, 0), r(0, 1), r(0, 2), 0,       r(1, 0), r(1, 1),
                         r(1, 2), 0,       r(2, 0), r(2, 1), r(2, 2), 0};
  dGeomSetBody(shape, base.id);
  dGeomSetOffsetPosition(shape, p_CS.x(), p_CS.y(), p_CS.z());
  dGeomSetOffsetRotation(shape, rows);
  shape_radius_m = size.norm();
}

void Plant::World::Place(const SensorsTruth& state) {
  for (const auto& field : kSensorFields) {
    if (!std::isfinite(state.*field.in_double)) {
      throw PlantError(fmt::format("cannot start at {} = {}", field.column, state.*field.in_double));
    }
  }
  if (broken) {
    Destroy();
    Create();
  }
  dRandSetSeed(0);  // ODE's generator is the process's: every flight begins with the same
  event = FlightEvent::kNone;
  event_text.clear();
  time_ns = next_sample_ns = 0;

  const Matrix3d R_WB = FromEuler(state.roll_rad, state.pitch_rad, state.yaw_rad);
  const Vector3d p_WB(state.x_m, state.y_m, state.z_m), v_WB(state.vx_m_s, state.vy_m_s, state.vz_m_s);
  const Vector3d w_WB(state.wx_rad_s, state.wy_rad_s, state.wz_rad_s);
  const auto place = [](const Body& body, const Vector3d& com, const Matrix3d& R, const Vector3d& v,
                        const Vector3d& w) {
    dBodySetPosition(body.id, com.x(), com.y(), com.z());
    SetRotation(body.id, R);
    dBodySetLinearVel(body.id, v.x(), v.y(), v.z());
    dBodySetAngularVel(body.id, w.x(), w.y(), w.z());
    dBodySetForce(body.id, 0, 0, 0);
    dBodySetTorque(body.id, 0, 0, 0);
  };
  const Vector3d base_com = R_WB * base.p_com_m;
  place(base, p_WB + base_com, R_WB, v_WB + w_WB.cross(base_com), w_WB);

  const std::array<double, 2> angles = {state.alpha_r_rad, state.alpha_l_rad};
  const std::array<double, 2> rates = {state.alpha_r_rad_s, state.alpha_l_rad_s};
  for (std::size_t side = 0; side < thrusters.size(); ++side) {
    const TiltingThruster& thruster = model.thrusters[side];
    const Matrix3d turn = Eigen::AngleAxisd(angles[side], thruster.axis_B).toRotationMatrix();
    const Vector3d to_hinge = R_WB * thruster.p_BH_m;
    const Vector3d to_com =
        R_WB * turn * (thruster.p_BT_m + thruster.R_BT * thruster.body.p_com_m - thruster.p_BH_m);
    const Vector3d w = w_WB + R_WB * thruster.axis_B * rates[side];
    place(thrusters[side], p_WB + to_hinge + to_com, R_WB * turn * thruster.R_BT,
          v_WB + w_WB.cross(to_hinge) + w.cross(to_com), w);
  }
  FindContacts();
  CheckEvent();
  Sample();
}

SensorsTruth Plant::World::Observe() const {
  const Matrix3d R = base.Attitude();
  const Vector3d to_origin = -(R * base.p_com_m);
  const Vector3d w = base.AngularVelocity();
  const Vector3d p = base.Com() + to_origin;
  const Vector3d v = base.Velocity() + w.cross(to_origin);
  SensorsTruth state;
  state.x_m = p.x();
  state.y_m = p.y();
  state.z_m = p.z();
  state.roll_rad = std::atan2(R(2, 1), R(2, 2));
  state.pitch_rad = std::asin(std::clamp(-R(2, 0), -1.0, 1.0));
  state.yaw_rad = std::atan2(R(1, 0), R(0, 0));
  if (state.yaw_rad <= -std::numbers::pi) state.yaw_rad = std::numbers::pi;
  state.alpha_r_rad = dJointGetHingeAngle(hinges[VehicleModel::kRight]);
  state.alpha_l_rad = dJointGetHingeAngle(hinges[VehicleModel::kLeft]);
  state.vx_m_s = v.x();
  state.vy_m_s = v.y();
  state.vz_m_s = v.z();
  state.wx_rad_s = w.x();
  state.wy_rad_s = w.y();
  state.wz_rad_s = w.z();
  state.alpha_r_rad_s = dJointGetHingeAngleRate(hinges[VehicleModel::kRight]);
  state.alpha_l_rad_s = dJointGetHingeAngleRate(hinges[VehicleModel::kLeft]);
  return state;
}

void Plant::World::StepOnce(const ActuatorsTruth& input) {
  const std::array<double, 2> forces = {input.f_r_n, input.f_l_n};
  const std::array<double, 2> torques = {input.tau_r_nm, input.tau_l_nm};
  for (std::size_t side = 0; side < thrusters.size(); ++side) {
    const TiltingThruster& thruster = model.thrusters[side];
    const Vector3d force = thruster.thrust_axis_T * forces[side];
    const Vector3d drag = force * (thruster.direction * thruster.drag_ratio_m);
    dBodyAddRelForce(thrusters[side].id, force.x(), force.y(), force.z());
    dBodyAddRelTorque(thrusters[side].id, drag.x(), drag.y(), drag.z());
    dJointAddHingeTorque(hinges[side], torques[side]);
  }
  for (int i = 0; i < contact_count; ++i) {
    dContact contact{};
    contact.surface.mode = dContactSoftERP | dContactSoftCFM | dContactApprox1;
    contact.surface.mu = 0.8;
    contact.surface.soft_erp = 0.2;
    contact.surface.soft_cfm = 1e-4;
    contact.geom = contacts[static_cast<std::size_t>(i)];
    dJointAttach(dJointCreateContact(world, contact_joints, &contact), dGeomGetBody(contact.geom.g1),
                 dGeomGetBody(contact.geom.g2));
  }
  dWorldStep(world, step_s);
  if (contact_count > 0) dJointGroupEmpty(contact_joints);
  time_ns += options.step_ns;
  FindContacts();
}

void Plant::World::FindContacts() {
  contact_count = 0;
  // Looking at the height first spares the collision of a flying vehicle; written so that NaN goes no
  // further.
  if (!options.ground || !(dGeomGetPosition(shape)[2] <= shape_radius_m)) return;
  contact_count = dCollide(shape, ground, kContactsMax, contacts.data(), sizeof(dContactGeom));
}

void Plant::World::Sample() {
  if (sensor_period_ns <= options.step_ns) return;
  if (time_ns < next_sample_ns) return;
  sample = Observe();
  next_sample_ns += sensor_period_ns;
}

void Plant::World::SetEvent(FlightEvent kind, std::string text) {
  event = kind;
  event_text = std::move(text);
}

void Plant::World::CheckEvent() {
  if (event == FlightEvent::kNotFinite) return;
  // A sum is finite only if its terms are; the hinges carry what happens to one body to the others.
  const Vector3d p = base.Com();
  const dReal* q = dBodyGetQuaternion(base.id);
  const double sum = p.sum() + q[0] + q[1] + q[2] + q[3] + base.Velocity().sum() +
                     base.AngularVelocity().sum() + thrusters[0].AngularVelocity().sum() +
                     thrusters[1].AngularVelocity().sum();
  if (!std::isfinite(sum)) {
    SetEvent(FlightEvent::kNotFinite, fmt::format("the state of '{}' is not finite", model.base.link));
    return;
  }
  if (event != FlightEvent::kNone) return;
  const dReal* R = dBodyGetRotation(base.id);
  if (p.squaredNorm() > kPositionMax_m * kPositionMax_m) {
    SetEvent(FlightEvent::kTooFar, fmt::format("'{}' is {:.0f} m from the origin, limit {:.0f} m",
                                               model.base.link, p.norm(), kPositionMax_m));
  } else if (R[10] < 0) {
    SetEvent(FlightEvent::kTilted,
             fmt::format("'{}' is tilted by {:.1f} deg, limit 90 deg", model.base.link,
                         std::acos(std::clamp(R[10], -1.0, 1.0)) * 180 / std::numbers::pi));
  } else if (contact_count > 0) {
    SetEvent(FlightEvent::kGroundStrike,
             fmt::format("'{}' touches the ground at ({:.2f}, {:.2f}) m with {:.2f} m/s", model.base.link,
                         contacts[0].pos[0], contacts[0].pos[1], base.Velocity().norm()));
  }
}

Plant::Plant(const VehicleModel& model, const PlantOptions& options)
    : world_(std::make_unique<World>(model, options)) {
  Reset({0, 0, 1}, {0, 0, 0});
}

Plant::~Plant() = default;

void Plant::Reset(const std::array<double, 3>& position_m, const std::array<double, 3>& attitude_rad) {
  SensorsTruth state;
  state.x_m = position_m[0];
  state.y_m = position_m[1];
  state.z_m = position_m[2];
  state.roll_rad = attitude_rad[0];
  state.pitch_rad = attitude_rad[1];
  state.yaw_rad = attitude_rad[2];
  state.alpha_r_rad = world_->model.hover.alpha_r_rad;
  state.alpha_l_rad = world_->model.hover.alpha_l_rad;
  Reset(state);
}

void Plant::Reset(const SensorsTruth& state) { world_->Place(state); }

ActuatorsTruth Plant::Step(const ActuatorsTruth& input) {
  const ActuatorsTruth in_force = Saturate(input);
  if (world_->event == FlightEvent::kNotFinite) return in_force;
  for (const auto& field : kActuatorFields) {
    if (std::isfinite(in_force.*field.in_double)) continue;
    world_->SetEvent(FlightEvent::kNotFinite, fmt::format("the input {} is not a number", field.column));
    return in_force;
  }
  try {
    world_->StepOnce(in_force);
  } catch (const PlantError& error) {
    world_->broken = true;
    world_->SetEvent(FlightEvent::kNotFinite, error.what());
    return in_force;
  }
  world_->CheckEvent();
  world_->Sample();
  return in_force;
}

ActuatorsTruth Plant::Saturate(const ActuatorsTruth& input) const {
  ActuatorsTruth saturated;
  for (const auto& field : kActuatorFields) {
    // clamp() hands on a NaN.
    saturated.*field.in_double = std::clamp(input.*field.in_double, world_->input_min.*field.in_double,
                                            world_->input_max.*field.in_double);
  }
  return saturated;
}

namespace {

// From world rates.
void ExpressRates(RatesFrame frame, SensorsTruth& state) {
  if (frame == RatesFrame::kWorld) return;
  const Vector3d w_W(state.wx_rad_s, state.wy_rad_s, state.wz_rad_s);
  Vector3d w = FromEuler(state.roll_rad, state.pitch_rad, state.yaw_rad).transpose() * w_W;
  if (frame == RatesFrame::kEuler) {
    const double sin_roll = std::sin(state.roll_rad), cos_roll = std::cos(state.roll_rad);
    const double yaw_rate = (w.y() * sin_roll + w.z() * cos_roll) / std::cos(state.pitch_rad);
    w = Vector3d(w.x() + yaw_rate * std::sin(state.pitch_rad), w.y() * cos_roll - w.z() * sin_roll, yaw_rate);
  }
  state.wx_rad_s = w.x();
  state.wy_rad_s = w.y();
  state.wz_rad_s = w.z();
}

}  // namespace

SensorsTruth Plant::State(RatesFrame frame) const {
  SensorsTruth state = world_->Observe();
  ExpressRates(frame, state);
  return state;
}

SensorsTruth Plant::ReadSensors(RatesFrame frame) const {
  if (world_->sensor_period_ns <= world_->options.step_ns) return State(frame);
  SensorsTruth state = world_->sample;
  ExpressRates(frame, state);
  return state;
}

FlightEvent Plant::Event() const { return world_->event; }

std::string Plant::EventText() const { return world_->event_text; }

double Plant::Energy() const {
  double energy = 0;
  for (const World::Body& body : {world_->base, world_->thrusters[0], world_->thrusters[1]}) {
    const Vector3d w_body = body.Attitude().transpose() * body.AngularVelocity();
    energy += 0.5 * body.mass_kg * body.Velocity().squaredNorm() +
              0.5 * w_body.dot(body.inertia_kg_m2 * w_body) +
              body.mass_kg * world_->options.gravity_m_s2 * body.Com().z();
  }
  return energy;
}

std::array<double, 6> Plant::Momentum() const {
  Vector3d linear = Vector3d::Zero(), angular = Vector3d::Zero();
  for (const World::Body& body : {world_->base, world_->thrusters[0], world_->thrusters[1]}) {
    const Matrix3d R = body.Attitude();
    const Vector3d p = body.mass_kg * body.Velocity();
    linear += p;
    angular += body.Com().cross(p) + R * (body.inertia_kg_m2 * (R.transpose() * body.AngularVelocity()));
  }
  return {linear.x(), linear.y(), linear.z(), angular.x(), angular.y(), angular.z()};
}

double Plant::HingeGap() const {
  double gap = 0;
  for (const dJointID hinge : world_->hinges) {
    dVector3 first, second;
    dJointGetHingeAnchor(hinge, first);
    dJointGetHingeAnchor2(hinge, second);
    gap = std::max(gap, (ToVector(first) - ToVector(second)).norm());
  }
  return gap;
}

}  // namespace tiltproof::plant
