// The motion of the hinges in one step: jams, position servos, and stops that hold at any step.
//
// ODE feels a stop only when a step starts beyond it, so that a light hinge flies far through it within one step. A step
// in which a hinge meets its stop, or turns far, is therefore repeated in short steps. A hinge that would pass its stop in
// one of them is caught: a motor ends the short step at the stop, and ODE stops the hinge there in the next one. The
// impact is inelastic, and it pushes the main body. All other steps stay as they are.
//
// ODE computes an angle by an arc tangent, which costs several percent of a step. The angle of a hinge that is driven by
// torque matters only near its stops: farther away a bound on what it has turned since takes its place.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "plant/plant_world.h"

namespace tiltproof::plant {
namespace {

// A motor works against its stops in ODE: it stays this far inside them.
constexpr double kShort_rad = 1e-4;
// ODE holds a hinge that is at its stop or beyond when a step starts. A caught hinge therefore ends its step just
// beyond the stop, and a hinge is caught when it would end it farther out.
constexpr double kBeyond_rad = 1e-6, kCatch_rad = 1e-5;
// A step is too long for a hinge that leaves its stop by more than this, or turns by more than this share of the way
// between its stops. It is divided into steps of at most this length.
constexpr double kAtStop_rad = 1e-3, kLeaves_rad = 0.02, kShareOfWay = 0.25, kFine_s = 0.5e-3;
// A hinge that is farther from its stops than this before a step, and turns by less than this within it, meets none and
// has not turned far. The bound on what it has turned: its rate times the step, and what the axes of ODE's bodies are
// off while these turn by less than kSlow_rad.
constexpr double kFar_rad = 0.3, kSlow_rad = 0.05, kUnseen_rad = 2e-4;
// The angle is measured again when it may have changed by more than this, so that a faster step finds it good enough.
constexpr double kSince_rad = 0.05;
// Stronger than any servo.
constexpr double kMotorMax_nm = 100;

// The angle to which a position servo turns its hinge within the step: at its largest speed while the command is
// farther away than the lag allows, then exponentially.
double Followed(const Hinge& hinge, double angle_rad, double command_rad, double step_s) {
  const double lag_s = hinge.time_constant_s, speed_rad_s = hinge.speed_max_rad_s;
  double left_rad = command_rad - angle_rad, time_s = step_s;
  if (speed_rad_s > 0) {
    const double far_rad = std::abs(left_rad) - speed_rad_s * lag_s;
    const double turning_s = std::clamp(far_rad / speed_rad_s, 0.0, time_s);
    left_rad -= std::copysign(speed_rad_s * turning_s, left_rad);
    time_s -= turning_s;
  }
  if (lag_s > 0) return command_rad - left_rad * std::exp(-time_s / lag_s);
  return speed_rad_s > 0 ? command_rad - left_rad : command_rad;
}

}  // namespace

void Plant::World::Tilting::Drive(double torque_max_nm, double rate_rad_s) {
  if (torque_max_nm == 0 && motor_max_nm == 0) return;
  motor_max_nm = torque_max_nm;
  motor_rate_rad_s = rate_rad_s;
  dJointSetHingeParam(hinge, dParamFMax, torque_max_nm);
  if (torque_max_nm > 0) dJointSetHingeParam(hinge, dParamVel, rate_rad_s);
}

// A held hinge turns by a motor that is stronger than the servo, a position servo is a motor, and the other servos
// are torques.
void Plant::World::DriveHinges(const Disturbance& disturbance, double length_s) {
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    const Hinge& hinge = model.hinges[i];
    const Disturbance::Hinge& held = disturbance.hinges[i];
    const double angle_rad = tilting[i].angle_rad;
    const double command = input[thrusts.size() + i];
    const bool by_torque = hinge.servo == ServoMode::kTorque;
    if (tilting[i].caught) {
      // It has its motor.
    } else if (!held.held && by_torque) {
      tilting[i].Drive(0, 0);
    } else {
      const double wanted_rad_s =
          held.held ? held.rate_rad_s
                    : (Followed(hinge, angle_rad, command, length_s) - angle_rad) / length_s;
      const double down = (hinge.angle_min_rad + kShort_rad - angle_rad) / length_s;
      const double up = (hinge.angle_max_rad - kShort_rad - angle_rad) / length_s;
      tilting[i].Drive(held.held || hinge.torque_max_nm == 0 ? kMotorMax_nm : hinge.torque_max_nm,
                       std::clamp(wanted_rad_s, std::min(down, 0.0), std::max(up, 0.0)));
    }
    if (by_torque) dJointAddHingeTorque(tilting[i].hinge, command);
  }
}

void Plant::World::SaveBodies() {
  const auto save = [](Body& body) {
    const auto copy = [](auto& to, const dReal* from) { std::copy_n(from, to.size(), to.begin()); };
    copy(body.saved.position, dBodyGetPosition(body.id));
    copy(body.saved.quaternion, dBodyGetQuaternion(body.id));
    copy(body.saved.velocity, dBodyGetLinearVel(body.id));
    copy(body.saved.rates, dBodyGetAngularVel(body.id));
  };
  save(base);
  for (Tilting& each : tilting) save(each.body);
}

// The forces on the bodies are zero, as after each step of ODE.
void Plant::World::RestoreBodies() {
  const auto restore = [](const Body& body) {
    const auto& [p, q, v, w] = body.saved;
    dBodySetPosition(body.id, p[0], p[1], p[2]);
    dBodySetQuaternion(body.id, q.data());
    dBodySetLinearVel(body.id, v[0], v[1], v[2]);
    dBodySetAngularVel(body.id, w[0], w[1], w[2]);
  };
  restore(base);
  for (const Tilting& each : tilting) restore(each.body);
  FindContacts();
}

void Plant::World::MeasureHinges() {
  for (Tilting& each : tilting) {
    each.angle_rad = dJointGetHingeAngle(each.hinge);
    each.turned_since_rad = 0;
  }
}

// True when every hinge is driven by torque alone, and is far from its stops.
bool Plant::World::FarFromStops(const Disturbance& disturbance) const {
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    const Hinge& hinge = model.hinges[i];
    if (hinge.servo != ServoMode::kTorque || disturbance.hinges[i].held) return false;
    if (tilting[i].turned_since_rad > kSince_rad) return false;
    const double near_rad = kFar_rad + tilting[i].turned_since_rad, angle_rad = tilting[i].angle_rad;
    // Without so much room the share of the way that is far may be less than what counts as little.
    if (!(angle_rad - hinge.angle_min_rad > near_rad && hinge.angle_max_rad - angle_rad > near_rad))
      return false;
  }
  return true;
}

// True when no body has turned by more than kSlow_rad in a step. Adds to the bounds on the angles.
bool Plant::World::TurnedLittle() {
  const auto turned_rad = [&](const dReal* w) {
    return (std::abs(w[0]) + std::abs(w[1]) + std::abs(w[2])) * step_s;
  };
  const dReal* of_base = dBodyGetAngularVel(base.id);
  if (!(turned_rad(of_base) < kSlow_rad)) return false;
  for (Tilting& each : tilting) {
    const dReal* w = dBodyGetAngularVel(each.body.id);
    const std::array<dReal, 3> relative = {w[0] - of_base[0], w[1] - of_base[1], w[2] - of_base[2]};
    const double own_rad = turned_rad(relative.data());
    if (!(own_rad < kSlow_rad)) return false;
    each.turned_since_rad += own_rad + kUnseen_rad;
  }
  return true;
}

// Measures the hinges after a step, and keeps the angles before it.
void Plant::World::MeasureTurns(double length_s) {
  for (Tilting& each : tilting) {
    each.next_angle_rad = dJointGetHingeAngle(each.hinge);
    // ODE's angle is within half a turn. A light hinge may turn farther within one step.
    const double turned_rad = dJointGetHingeAngleRate(each.hinge) * length_s;
    if (std::abs(each.angle_rad + turned_rad - each.next_angle_rad) > std::numbers::pi)
      each.next_angle_rad = each.angle_rad + turned_rad;
  }
}

// True when no hinge can have been too fast for the step, although it is not known exactly where each one began.
bool Plant::World::MetNoStop() const {
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    const double min_rad = model.hinges[i].angle_min_rad, max_rad = model.hinges[i].angle_max_rad;
    const double after_rad = tilting[i].next_angle_rad;
    const double turned_rad = std::abs(after_rad - tilting[i].angle_rad) + tilting[i].turned_since_rad;
    if (after_rad > max_rad || after_rad < min_rad || turned_rad > kShareOfWay * (max_rad - min_rad))
      return false;
  }
  return true;
}

// True when the step was too long for a hinge.
bool Plant::World::TurnedTooFar() const {
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    const double min_rad = model.hinges[i].angle_min_rad, max_rad = model.hinges[i].angle_max_rad;
    const double before_rad = tilting[i].angle_rad, after_rad = tilting[i].next_angle_rad;
    const double turned_rad = std::abs(after_rad - before_rad);
    if (after_rad > max_rad + kCatch_rad || after_rad < min_rad - kCatch_rad) return true;
    const bool at_stop = before_rad > max_rad - kAtStop_rad || before_rad < min_rad + kAtStop_rad;
    if ((at_stop && turned_rad > kLeaves_rad) || turned_rad > kShareOfWay * (max_rad - min_rad)) return true;
  }
  return false;
}

// Gives each hinge that has just turned through its stop a motor that ends the step at the stop. Returns whether there
// is one that had none.
bool Plant::World::CatchHinges(double length_s) {
  MeasureTurns(length_s);
  bool caught = false;
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    Tilting& each = tilting[i];
    const Hinge& hinge = model.hinges[i];
    const bool above = each.next_angle_rad > hinge.angle_max_rad + kCatch_rad;
    if (each.caught || (!above && each.next_angle_rad >= hinge.angle_min_rad - kCatch_rad)) continue;
    const double stop_rad = above ? hinge.angle_max_rad + kBeyond_rad : hinge.angle_min_rad - kBeyond_rad;
    caught = each.caught = true;
    // No stop beside the motor. Without finite ones ODE would not notice that the hinge has left its stop.
    dJointSetHingeParam(each.hinge, dParamLoStop, -std::numbers::pi);
    dJointSetHingeParam(each.hinge, dParamHiStop, std::numbers::pi);
    dJointSetHingeParam(each.hinge, dParamFMax, dInfinity);
    dJointSetHingeParam(each.hinge, dParamVel, (stop_rad - each.angle_rad) / length_s);
  }
  return caught;
}

void Plant::World::ReleaseHinges() {
  for (std::size_t i = 0; i < tilting.size(); ++i) {
    Tilting& each = tilting[i];
    each.angle_rad = each.next_angle_rad;
    each.turned_since_rad = 0;
    if (!each.caught) continue;
    each.caught = false;
    dJointSetHingeParam(each.hinge, dParamLoStop, model.hinges[i].angle_min_rad);
    dJointSetHingeParam(each.hinge, dParamHiStop, model.hinges[i].angle_max_rad);
    dJointSetHingeParam(each.hinge, dParamFMax, each.motor_max_nm);
    dJointSetHingeParam(each.hinge, dParamVel, each.motor_rate_rad_s);
  }
}

void Plant::World::StepHinged(const Disturbance& disturbance) {
  const bool is_far = is_slow && FarFromStops(disturbance);
  if (!is_far && std::ranges::any_of(tilting, [](const Tilting& each) { return each.turned_since_rad > 0; }))
    MeasureHinges();
  SaveBodies();
  Advance(disturbance, step_s);
  is_slow = TurnedLittle();
  if (is_far && is_slow) return;
  MeasureTurns(step_s);
  if (is_far) {
    if (MetNoStop()) return ReleaseHinges();
    // Rare: now the angles before the step are needed.
    RestoreBodies();
    MeasureHinges();
    Advance(disturbance, step_s);
    MeasureTurns(step_s);
  }
  if (!TurnedTooFar()) return ReleaseHinges();
  is_slow = false;
  RestoreBodies();
  const double count = std::ceil(step_s / kFine_s), length_s = step_s / count;
  for (double done = 0; done < count; ++done) {
    SaveBodies();
    Advance(disturbance, length_s);
    while (CatchHinges(length_s)) {
      RestoreBodies();
      Advance(disturbance, length_s);
    }
    ReleaseHinges();
  }
}

}  // namespace tiltproof::plant
