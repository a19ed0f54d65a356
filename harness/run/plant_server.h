// The server end of the line (paper, Figure 5): the plant, its sensors and actuators with their faults, and
// the trace.
//
// Everything that reads or moves the plant is here, in the order of a control period:
//
//   request arrives -> plant state -> sensor faults -> message -> frame  (sent back at once)
//   actuators arrive -> decode -> actuator faults -> input in force from the next step boundary -> row
//
// Sensors are the state at the last step boundary at or before the arrival of the request's last byte. An
// accepted actuator message takes effect at the first step boundary at or after its last byte's arrival and
// holds; before the first one the model's hover input holds. The plant stands still until the server accepts
// `start` (provant: the first id 3): that is t = 0.
//
// The same code serves in one process with the line (lockstep), in a process of its own (lockstep,
// distributed) and behind a real port (the plant node). Times are the line's: see harness/run/line.h.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "faults/schedule.h"
#include "harness/reference/trajectory.h"
#include "harness/run/event_log.h"
#include "harness/run/line.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "link/frame.h"
#include "plant/plant.h"

namespace tiltproof::harness {

// Columns of a flight's trace: TraceColumns(), then active_<id> for each fault of the scenario.
std::vector<std::string> FlightColumns(const Scenario& scenario);

// Records since the last TakeLog(); counters are totals. Times are simulation time.
struct PlantLog {
  std::vector<double> rows;  // whole rows, row by row
  std::array<double, kActuatorCount> hover_input{}, input_min{}, input_max{};
  std::int64_t starts_accepted_count = 0;
  std::vector<TimeNs> request_times_ns, actuator_times_ns;
  std::vector<RunEvent> events;
  std::vector<faults::Activation> activations;
  std::vector<std::int64_t> activation_counts;
};

class PlantServer {
 public:
  // One frame to send back, now.
  using Reply = std::function<void(std::span<const std::uint8_t> frame)>;

  struct State {
    TimeNs origin_ns = kNever;                     // the line's time of t = 0; kNever before
    TimeNs reached_ns = 0;                         // simulation time of the last step boundary
    TimeNs quiet_until_ns = kNever;                // the line time up to which Advance() has nothing to do
    bool over = false;                             // the vehicle is lost: it diverged or struck the ground
    EndReason end_reason = EndReason::kCompleted;  // why it is over
    std::string end_text;
    bool started() const { return origin_ns != kNever; }
  };

  virtual ~PlantServer() = default;
  // Steps to the last boundary at or before `to`. A boundary is left, and its row logged with `counts`, only
  // when time has passed it.
  virtual void Advance(TimeNs to, const LineCounts& counts) = 0;
  // Bytes that arrived, the last of them at `arrival`, to which the plant has been advanced.
  virtual void Receive(TimeNs arrival, std::span<const std::uint8_t> bytes, const Reply& reply) = 0;
  // The flight ends at `end`, on the grid or not: the last row. Not after it is over.
  virtual void Finish(TimeNs end, const LineCounts& counts) = 0;
  virtual const State& state() const = 0;
  virtual PlantLog TakeLog() = 0;
};

class LocalPlantServer final : public PlantServer {
 public:
  LocalPlantServer(const Scenario& scenario, const plant::VehicleModel& model);

  void Advance(TimeNs to, const LineCounts& counts) override;
  void Receive(TimeNs arrival, std::span<const std::uint8_t> bytes, const Reply& reply) override;
  void Finish(TimeNs end, const LineCounts& counts) override;
  const State& state() const override { return state_; }
  PlantLog TakeLog() override;

  // For observers.
  SensorsTruth Truth() const { return plant_.State(); }
  const ActuatorsTruth& in_force() const { return in_force_; }
  const ActuatorsTruth& commanded() const { return commanded_; }

 private:
  void OnClientMessage(TimeNs arrival, std::span<const std::uint8_t> payload, const Reply& reply);
  void OnStart(TimeNs arrival);
  void AnswerSensorRequest(TimeNs arrival, const Reply& reply);
  void PutInputInForce();
  void LeaveBoundary(const LineCounts& counts);
  void LogRow(TimeNs at, const LineCounts& counts);
  TimeNs SimTime(TimeNs line_time) const { return line_time - state_.origin_ns; }

  const Scenario& scenario_;
  Trajectory trajectory_;
  plant::Plant plant_;
  faults::FaultSchedule faults_;
  link::FrameDecoder decoder_;
  State state_;
  PlantLog log_;
  EventLog events_;
  std::size_t column_count_;

  // The plant stands at this step boundary; `boundary_left_` when nothing more can happen at it.
  TimeNs boundary_ns_ = kNever;
  bool boundary_left_ = false;
  ActuatorsTruth commanded_;           // last accepted, or the hover input
  TimeNs commanded_from_ns_ = kNever;  // boundary at which it takes force; kNever when it has
  TimeNs next_fault_edge_ns_ = kPowerOn;
  ActuatorsTruth in_force_;  // commanded_ after the actuator faults
  std::optional<Sensors> sensed_;
  std::optional<Actuators> asked_;
};

}  // namespace tiltproof::harness
