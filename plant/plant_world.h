// The bodies and hinges of a vehicle in ODE's world, and one step of them. Internal to the plant.
#pragma once

#include <ode/ode.h>

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "plant/plant.h"
#include "plant/state_row.h"

namespace tiltproof::plant {

inline Eigen::Vector3d ToVector(const dReal* v) { return {v[0], v[1], v[2]}; }

// Throws BrokenInvariant when a row does not have the table's size.
void CheckSize(std::size_t size, const SignalTable& table, const char* what);

struct Plant::World {
  using Vector3d = Eigen::Vector3d;
  using Matrix3d = Eigen::Matrix3d;

  // ODE's state of a body when a step starts.
  struct SavedBody {
    std::array<dReal, 3> position{};
    std::array<dReal, 4> quaternion{};
    std::array<dReal, 3> velocity{}, rates{};
  };

  // A body of the model, and ODE's at its centre of mass.
  struct Body {
    dBodyID id = nullptr;
    Vector3d p_com_m;
    Matrix3d inertia_kg_m2;
    double mass_kg = 0;
    SavedBody saved;

    Vector3d Com() const;
    Matrix3d Attitude() const;
    Vector3d Velocity() const;
    Vector3d AngularVelocity() const;
  };

  // A body on its hinge.
  struct Tilting {
    Body body;
    dJointID hinge = nullptr;
    double angle_rad = 0, next_angle_rad = 0;       // before the step, and after it
    double turned_since_rad = 0;                    // at most, since angle_rad was measured
    double motor_max_nm = 0, motor_rate_rad_s = 0;  // 0: no motor
    bool caught = false;                            // this step ends at a stop

    void Drive(double torque_max_nm, double rate_rad_s);
  };

  // The effect of a rotor on its body, along the body's axes.
  struct Thrust {
    dBodyID body = nullptr;
    Vector3d axis, to_point_m;  // unit; from the centre of mass to the point that the thrust pushes
    bool at_com = true;         // to_point_m is zero
    double drag_ratio_m = 0;    // with the sign of the direction
    double rise = 1, fall = 1;  // the share of the way to a larger and a smaller command that one step covers
  };

  // A shape in ODE's space, on its body.
  struct Shape {
    dGeomID geom = nullptr;
    double radius_m = 0;  // no point of the shape is farther from its centre
  };

  // A point at which a shape touches the ground.
  struct Contact {
    dContactGeom geom;
    std::size_t shape = 0;
  };

  World(const VehicleModel& vehicle, const PlantOptions& plant_options);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  void Create();
  void Destroy();
  Body CreateBody(const RigidBody& body, const Vector3d& p_BL, const Matrix3d& R_BL) const;
  Thrust CreateThrust(const Rotor& rotor) const;

  void Place(std::span<const double> state);
  void PutBodies(std::span<const double> state);
  void StepOnce(const Disturbance& disturbance);
  void Advance(const Disturbance& disturbance, double length_s);
  void Rebuild(const VehicleModel& as);
  void ChangeBodies(const Disturbance& disturbance);
  // plant/hinge_motion.cpp
  void StepHinged(const Disturbance& disturbance);
  void DriveHinges(const Disturbance& disturbance, double length_s);
  void SaveBodies();
  void RestoreBodies();
  void MeasureHinges();
  bool FarFromStops(const Disturbance& disturbance) const;
  bool TurnedLittle();
  bool MetNoStop() const;
  void MeasureTurns(double length_s);
  bool TurnedTooFar() const;
  bool CatchHinges(double length_s);
  void ReleaseHinges();
  void Push(const Disturbance& disturbance);
  void Observe(std::span<double> state) const;  // world rates
  // The same, computed once after each step.
  const std::vector<double>& Observed();
  BaseMotion MotionOfBase() const;
  void Sample();
  void CheckEvent();
  void SetEvent(FlightEvent kind, std::string text);

  // plant/ground_contact.cpp
  void CreateShapes();
  void FindContacts();
  // Call it after all forces of the part of a step are added.
  void AddContactJoints(double length_s);
  // The reason that the present touch of the ground is an event; empty when it is none.
  std::string TouchProblem() const;
  double Clearance_m() const;

  const VehicleModel nominal;  // as it was loaded
  VehicleModel model;          // with the masses of the latest disturbance
  Disturbance bodies;          // of which that is: its factors of mass and inertia, and its shift
  PlantOptions options;
  VehicleSignals signals;
  StateLayout at;
  std::vector<double> input_min, input_max;
  std::vector<double> input;  // in force during the latest step
  std::vector<double> next_input;
  double step_s = 0;

  dWorldID world = nullptr;
  dThreadingImplementationID threading = nullptr;  // runs the step in the caller's thread
  bool broken = false;                             // an error left the step in the middle
  dJointGroupID contact_joints = nullptr;
  dGeomID ground = nullptr;
  std::vector<Shape> shapes;  // in the order of the model's
  double reach_m = 0;         // no point of a shape is farther from the main body's centre of mass
  Body base;
  std::vector<Tilting> tilting;  // one per hinge of the model
  std::vector<Thrust> thrusts;   // one per rotor of the model

  std::vector<Contact> contacts;
  std::string strike;  // a touch inside a step that is an event

  TimeNs time_ns = 0, sensor_period_ns = 0, next_sample_ns = 0;
  std::vector<double> sample;
  std::vector<double> observed;
  bool is_observed = false;
  bool is_slow = false;  // no body has turned far in the latest step
  SensorSuite sensors;
  FlightEvent event = FlightEvent::kNone;
  std::string event_text;
};

}  // namespace tiltproof::plant
