#include "plant/plant.h"

#include <fmt/core.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

#include "plant/disturbed_vehicle.h"
#include "plant/plant_world.h"

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

}  // namespace

Plant::Plant(const VehicleModel& model, const PlantOptions& options)
    : world_(std::make_unique<World>(model, options)) {
  Reset({0, 0, 1}, {0, 0, 0});
}

Plant::~Plant() = default;

void Plant::Reset(const std::array<double, 3>& position_m, const std::array<double, 3>& attitude_rad) {
  std::vector<double> state(world_->signals.states.size());
  std::copy(position_m.begin(), position_m.end(), state.begin() + world_->at.position);
  std::copy(attitude_rad.begin(), attitude_rad.end(), state.begin() + world_->at.attitude);
  const std::vector<double>& hinges = world_->model.hover.hinge_rad;
  std::copy(hinges.begin(), hinges.end(), state.begin() + world_->at.hinges);
  Reset(state);
}

void Plant::ResetOnGround(double x_m, double y_m, const std::array<double, 3>& attitude_rad) {
  constexpr double kDepth_m = 1e-9;  // a rounded height must not lift it off
  Reset({x_m, y_m, 0}, attitude_rad);
  Reset({x_m, y_m, -Clearance_m() - kDepth_m}, attitude_rad);
}

void Plant::Reset(std::span<const double> state) { world_->Place(state); }

void Plant::Step(std::span<const double> command, const Disturbance& disturbance) {
  std::vector<double>& in_force = world_->next_input;
  CheckSize(command.size(), world_->signals.inputs, "inputs");
  std::copy(command.begin(), command.end(), in_force.begin());
  InputInForce(in_force);
  if (world_->event == FlightEvent::kNotFinite) return;
  for (std::size_t i = 0; i < in_force.size(); ++i) {
    if (std::isfinite(in_force[i])) continue;
    world_->SetEvent(FlightEvent::kNotFinite,
                     fmt::format("the input {} is not a number", world_->signals.inputs[i].name));
    return;
  }
  if (const std::string_view problem = DisturbanceProblem(disturbance); !problem.empty()) {
    world_->SetEvent(FlightEvent::kNotFinite, std::string(problem));
    return;
  }
  std::swap(world_->input, world_->next_input);
  try {
    world_->StepOnce(disturbance);
  } catch (const PlantError& error) {
    world_->broken = true;
    world_->SetEvent(FlightEvent::kNotFinite, error.what());
    return;
  }
  world_->CheckEvent();
  world_->Sample();
  if (!world_->sensors.empty() && world_->event != FlightEvent::kNotFinite)
    world_->sensors.Step(world_->MotionOfBase(), world_->model.base.p_com_m);
}

void Plant::InputInForce(std::span<double> command) const {
  CheckSize(command.size(), world_->signals.inputs, "inputs");
  // clamp() passes a NaN through.
  for (std::size_t i = 0; i < command.size(); ++i)
    command[i] = std::clamp(command[i], world_->input_min[i], world_->input_max[i]);
  for (std::size_t i = 0; i < world_->thrusts.size(); ++i) {
    const World::Thrust& rotor = world_->thrusts[i];
    const double before = world_->input[i];
    if (const double share = command[i] > before ? rotor.rise : rotor.fall; share != 1)
      command[i] = before + share * (command[i] - before);
  }
}

void Plant::State(std::span<double> state, RatesFrame frame) const {
  CheckSize(state.size(), world_->signals.states, "states");
  const std::vector<double>& observed = world_->Observed();
  std::copy(observed.begin(), observed.end(), state.begin());
  ExpressRates(frame, world_->at, state);
}

void Plant::ReadSensors(std::span<double> sensors, RatesFrame frame) const {
  CheckSize(sensors.size(), world_->signals.sensors, "sensors");
  const std::span<double> states = sensors.first(world_->signals.states.size());
  Measure(sensors.subspan(states.size()));
  if (world_->sensor_period_ns <= world_->options.step_ns) return State(states, frame);
  std::copy(world_->sample.begin(), world_->sample.end(), states.begin());
  ExpressRates(frame, world_->at, states);
}

void Plant::Measure(std::span<double> readings) const { world_->sensors.Read(readings); }

FlightEvent Plant::Event() const { return world_->event; }

std::string Plant::EventText() const { return world_->event_text; }

bool Plant::OnGround() const { return !world_->contacts.empty(); }

double Plant::Clearance_m() const { return world_->Clearance_m(); }

double Plant::Energy() const {
  double energy = 0;
  const auto add = [&](const World::Body& body) {
    const Vector3d w_body = body.Attitude().transpose() * body.AngularVelocity();
    energy += 0.5 * body.mass_kg * body.Velocity().squaredNorm() +
              0.5 * w_body.dot(body.inertia_kg_m2 * w_body) +
              body.mass_kg * world_->options.gravity_m_s2 * body.Com().z();
  };
  add(world_->base);
  for (const World::Tilting& tilting : world_->tilting) add(tilting.body);
  return energy;
}

std::array<double, 6> Plant::Momentum() const {
  Vector3d linear = Vector3d::Zero(), angular = Vector3d::Zero();
  const auto add = [&](const World::Body& body) {
    const Matrix3d R = body.Attitude();
    const Vector3d p = body.mass_kg * body.Velocity();
    linear += p;
    angular += body.Com().cross(p) + R * (body.inertia_kg_m2 * (R.transpose() * body.AngularVelocity()));
  };
  add(world_->base);
  for (const World::Tilting& tilting : world_->tilting) add(tilting.body);
  return {linear.x(), linear.y(), linear.z(), angular.x(), angular.y(), angular.z()};
}

double Plant::HingeGap() const {
  double gap = 0;
  for (const World::Tilting& tilting : world_->tilting) {
    dVector3 first, second;
    dJointGetHingeAnchor(tilting.hinge, first);
    dJointGetHingeAnchor2(tilting.hinge, second);
    gap = std::max(gap, (ToVector(first) - ToVector(second)).norm());
  }
  return gap;
}

}  // namespace tiltproof::plant
