#include "plant/plant_world.h"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "link/check.h"
#include "plant/disturbed_vehicle.h"
#include "plant/ode_library.h"

namespace tiltproof::plant {
namespace {

static_assert(sizeof(dReal) == sizeof(double), "needs ODE built in double precision");

using Eigen::Matrix3d;
using Eigen::Vector3d;

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

// Samples under way are kept, and their number has a limit.
const std::vector<Sensor>& WithinMemory(const std::vector<Sensor>& sensors, TimeNs step_ns) {
  constexpr double kUnderWayMax = 100'000;
  for (const Sensor& sensor : sensors) {
    const double period_s = std::max(sensor.rate_hz > 0 ? 1 / sensor.rate_hz : 0, ToSeconds(step_ns));
    if (sensor.latency_s > kUnderWayMax * period_s)
      throw PlantError(
          fmt::format("sensor '{}': its latency of {} s is more than {:.0f} samples of {} s: lower its rate",
                      sensor.name, sensor.latency_s, kUnderWayMax, period_s));
  }
  return sensors;
}

// The share of the way that a first-order lag covers in one step; 1 without a lag.
double ShareOfLag(double time_constant_s, double step_s) {
  return time_constant_s > 0 ? -std::expm1(-step_s / time_constant_s) : 1;
}

}  // namespace

void CheckSize(std::size_t size, const SignalTable& table, const char* what) {
  if (size != table.size())
    ThrowBrokenInvariant(fmt::format("a row of {} has {} numbers, not {}", what, table.size(), size));
}

Vector3d Plant::World::Body::Com() const { return ToVector(dBodyGetPosition(id)); }
Matrix3d Plant::World::Body::Attitude() const { return ToMatrix(dBodyGetRotation(id)); }
Vector3d Plant::World::Body::Velocity() const { return ToVector(dBodyGetLinearVel(id)); }
Vector3d Plant::World::Body::AngularVelocity() const { return ToVector(dBodyGetAngularVel(id)); }

Plant::World::World(const VehicleModel& vehicle, const PlantOptions& plant_options)
    : nominal(vehicle),
      model(vehicle),
      options(plant_options),
      signals(model.signals()),
      at(model.hinges.size()),
      input_min(model.InputMin()),
      input_max(model.InputMax()),
      input(signals.inputs.size()),
      next_input(signals.inputs.size()),
      sample(signals.states.size()),
      sensors(WithinMemory(model.sensors, options.step_ns),
              {.surroundings = model.surroundings,
               .step_ns = options.step_ns,
               .gravity_m_s2 = options.gravity_m_s2},
              options.sensor_draws) {
  if (options.step_ns <= 0) throw PlantError("the step must be positive");
  if (model.rotors.size() > kRotorsMax || model.hinges.size() > kRotorsMax)
    throw PlantError(fmt::format("'{}' has more than {} rotors or hinges", model.name, kRotorsMax));
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
  tilting.clear();
  for (const Hinge& from : model.hinges) {
    Tilting& to = tilting.emplace_back();
    to.body = CreateBody(from.body, from.p_BT_m, from.R_BT);
    // ODE takes the bodies' present pose for the hinge angle 0.
    const dJointID hinge = to.hinge = dJointCreateHinge(world, nullptr);
    dJointAttach(hinge, to.body.id, base.id);
    dJointSetHingeAnchor(hinge, from.p_BH_m.x(), from.p_BH_m.y(), from.p_BH_m.z());
    dJointSetHingeAxis(hinge, from.axis_B.x(), from.axis_B.y(), from.axis_B.z());
    dJointSetHingeParam(hinge, dParamLoStop, from.angle_min_rad);
    dJointSetHingeParam(hinge, dParamHiStop, from.angle_max_rad);
    dJointSetHingeParam(hinge, dParamBounce, 0);
  }
  thrusts.clear();
  for (const Rotor& rotor : model.rotors) thrusts.push_back(CreateThrust(rotor));
  contact_joints = dJointGroupCreate(0);
  ground = dCreatePlane(nullptr, 0, 0, 1, 0);
  CreateShapes();
}

void Plant::World::Destroy() {
  for (const Shape& each : shapes) dGeomDestroy(each.geom);
  shapes.clear();
  if (ground != nullptr) dGeomDestroy(ground);
  if (contact_joints != nullptr) dJointGroupDestroy(contact_joints);
  if (world != nullptr) dWorldDestroy(world);
  // ODE insists that no job is left when the threading goes; after an error some are, so it stays: some
  // kilobytes.
  if (threading != nullptr && !broken) dThreadingFreeImplementation(threading);
  ground = nullptr;
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
  return {.id = id, .p_com_m = body.p_com_m, .inertia_kg_m2 = i, .mass_kg = body.mass_kg, .saved = {}};
}

Plant::World::Thrust Plant::World::CreateThrust(const Rotor& rotor) const {
  const Vector3d to_point_m = rotor.p_LR_m - model.Carrier(rotor).p_com_m;
  return {.body = rotor.hinge ? tilting.at(*rotor.hinge).body.id : base.id,
          .axis = rotor.thrust_axis_L,
          .to_point_m = to_point_m,
          .at_com = to_point_m.isZero(0),
          .drag_ratio_m = rotor.direction * rotor.drag_ratio_m,
          .rise = ShareOfLag(rotor.time_constant_up_s, step_s),
          .fall = ShareOfLag(rotor.time_constant_down_s, step_s)};
}

void Plant::World::Place(std::span<const double> state) {
  CheckSize(state.size(), signals.states, "states");
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (!std::isfinite(state[i]))
      throw PlantError(fmt::format("cannot start at {} = {}", signals.states[i].name, state[i]));
  }
  if (broken || bodies != Disturbance{}) Rebuild(nominal);
  bodies = {};
  for (Tilting& each : tilting) each.Drive(0, 0);
  // Rotors turn as for a hover.
  const std::vector<double>& hover = nominal.HoverInput();
  std::fill(input.begin(), input.end(), 0.0);
  std::copy_n(hover.begin(), std::min(hover.size(), input.size()), input.begin());
  dRandSetSeed(0);  // ODE's generator is the process's: every flight begins with the same
  event = FlightEvent::kNone;
  event_text.clear();
  strike.clear();
  time_ns = next_sample_ns = 0;
  PutBodies(state);
  FindContacts();
  CheckEvent();
  Sample();
  sensors.Start(MotionOfBase());
}

void Plant::World::PutBodies(std::span<const double> state) {
  is_observed = is_slow = false;
  const Vector3d angles = VectorAt(state, at.attitude);
  const Matrix3d R_WB = FromEuler(angles[0], angles[1], angles[2]);
  const Vector3d p_WB = VectorAt(state, at.position), v_WB = VectorAt(state, at.velocity);
  const Vector3d w_WB = VectorAt(state, at.rates);
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

  for (std::size_t i = 0; i < tilting.size(); ++i) {
    const Hinge& hinge = model.hinges[i];
    const Matrix3d turn = Eigen::AngleAxisd(state[at.hinges + i], hinge.axis_B).toRotationMatrix();
    const Vector3d to_hinge = R_WB * hinge.p_BH_m;
    const Vector3d to_com = R_WB * turn * (hinge.p_BT_m + hinge.R_BT * hinge.body.p_com_m - hinge.p_BH_m);
    const Vector3d w = w_WB + R_WB * hinge.axis_B * state[at.hinge_rates + i];
    place(tilting[i].body, p_WB + to_hinge + to_com, R_WB * turn * hinge.R_BT,
          v_WB + w_WB.cross(to_hinge) + w.cross(to_com), w);
  }
  MeasureHinges();
}

BaseMotion Plant::World::MotionOfBase() const {
  const Matrix3d R = base.Attitude();
  const Vector3d to_origin = -(R * base.p_com_m), w = base.AngularVelocity();
  return {.p_WB_m = base.Com() + to_origin,
          .v_WB_m_s = base.Velocity() + w.cross(to_origin),
          .w_WB_rad_s = w,
          .R_WB = R};
}

void Plant::World::Observe(std::span<double> state) const {
  const Matrix3d R = base.Attitude();
  const Vector3d to_origin = -(R * base.p_com_m);
  const Vector3d w = base.AngularVelocity();
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  SetVector(state, at.position, base.Com() + to_origin);
  SetVector(state, at.attitude,
            {std::atan2(R(2, 1), R(2, 2)), std::asin(std::clamp(-R(2, 0), -1.0, 1.0)),
             yaw <= -std::numbers::pi ? std::numbers::pi : yaw});
  SetVector(state, at.velocity, base.Velocity() + w.cross(to_origin));
  SetVector(state, at.rates, w);
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    state[at.hinges + i] = dJointGetHingeAngle(tilting[i].hinge);
    state[at.hinge_rates + i] = dJointGetHingeAngleRate(tilting[i].hinge);
  }
}

const std::vector<double>& Plant::World::Observed() {
  if (!is_observed) {
    observed.resize(signals.states.size());
    Observe(observed);
    is_observed = true;
  }
  return observed;
}

void Plant::World::Rebuild(const VehicleModel& as) {
  Destroy();
  model = as;
  Create();
}

// ODE has the bodies of a hinge turn about anchors that lie fixed in both: other masses take another world, which
// goes on from the same state. Rare: when such a disturbance begins, changes or ends.
void Plant::World::ChangeBodies(const Disturbance& disturbance) {
  if (disturbance.mass_factor == bodies.mass_factor && disturbance.inertia_factor == bodies.inertia_factor &&
      disturbance.com_shift_m == bodies.com_shift_m)
    return;
  Disturbance wanted;
  wanted.mass_factor = disturbance.mass_factor;
  wanted.inertia_factor = disturbance.inertia_factor;
  wanted.com_shift_m = disturbance.com_shift_m;
  std::vector<double> state(signals.states.size());
  Observe(state);
  Rebuild(WithBodies(nominal, wanted));
  bodies = wanted;
  PutBodies(state);
  FindContacts();
}

void Plant::World::Push(const Disturbance& disturbance) {
  const auto vector = [](const Disturbance::Vector& v) { return Vector3d(v[0], v[1], v[2]); };
  Vector3d force = vector(disturbance.force_n);
  if (model.drag != BodyDrag{})
    force += DragForce(model.drag, base.Velocity() - vector(disturbance.wind_m_s));
  const Vector3d torque = vector(disturbance.torque_nm), own_torque = vector(disturbance.torque_body_nm);
  // Adding a zero may change the sign of one.
  if (!force.isZero(0)) dBodyAddForce(base.id, force.x(), force.y(), force.z());
  if (!torque.isZero(0)) dBodyAddTorque(base.id, torque.x(), torque.y(), torque.z());
  if (!own_torque.isZero(0)) dBodyAddRelTorque(base.id, own_torque.x(), own_torque.y(), own_torque.z());
}

// With `input`.
void Plant::World::StepOnce(const Disturbance& disturbance) {
  is_observed = false;
  ChangeBodies(disturbance);
  if (tilting.empty())
    Advance(disturbance, step_s);
  else
    StepHinged(disturbance);
  time_ns += options.step_ns;
}

// One step of ODE.
void Plant::World::Advance(const Disturbance& disturbance, double length_s) {
  Push(disturbance);
  for (std::size_t i = 0; i < thrusts.size(); ++i) {
    const Thrust& rotor = thrusts[i];
    const Vector3d force = rotor.axis * (input[i] * disturbance.thrust_factor[i]);
    Vector3d torque = force * rotor.drag_ratio_m;
    if (!rotor.at_com) torque += rotor.to_point_m.cross(force);
    dBodyAddRelForce(rotor.body, force.x(), force.y(), force.z());
    dBodyAddRelTorque(rotor.body, torque.x(), torque.y(), torque.z());
  }
  DriveHinges(disturbance, length_s);
  AddContactJoints(length_s);
  dWorldStep(world, length_s);
  if (!contacts.empty()) dJointGroupEmpty(contact_joints);
  FindContacts();
}

void Plant::World::Sample() {
  if (sensor_period_ns <= options.step_ns) return;
  if (time_ns < next_sample_ns) return;
  Observe(sample);
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
  double sum = p.sum() + q[0] + q[1] + q[2] + q[3] + base.Velocity().sum() + base.AngularVelocity().sum();
  for (const Tilting& each : tilting) sum += each.body.AngularVelocity().sum();
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
  } else if (!contacts.empty() || !strike.empty()) {
    if (std::string problem = strike.empty() ? TouchProblem() : strike; !problem.empty())
      SetEvent(FlightEvent::kGroundStrike, std::move(problem));
  }
}

}  // namespace tiltproof::plant
