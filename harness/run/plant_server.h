// The server end of the line (paper, Figure 5): the plant, its sensors and actuators with their faults, and
// the trace.
//
// It takes checked messages (harness/run/message_receiver.h) and sends frames back. Everything that reads or
// moves the plant is here, in the order of a control period:
//
//   request arrives -> plant state -> sensor faults -> message -> frame  (sent back at once)
//   actuators arrive -> actuator faults -> limits, lag of rotors -> input in force from the next boundary -> row
//
// A protocol may let the server send by itself: each message every period, from t = 0 on, or from power-on where it
// answers before t = 0, or where the first command is t = 0. From then on the times do not shift.
//
// The sensors are the state at the last step boundary at or before the arrival of the request's last byte, or the time
// at which the server sends by itself. An accepted actuator message takes effect at the first step boundary at or after
// the arrival of its last byte, and holds. Before the first one, the model's hover input holds. Of several clients, the arbiter
// decides at each boundary. The plant does not move until the server
// accepts the protocol's message that starts: that is t = 0. A vehicle that is held (Scenario::held) does not move
// afterwards, either; time, sensors, inputs and rows go on.
//
// Each of several clients is asked and answered as if it were the only one. harness/run/arbiter.h decides
// whose actuators move the plant, and whose `start` is t = 0.
//
// The same code runs in one process with the line (lockstep), in its own process (lockstep, distributed) and
// behind a real port (the plant node). Times of the line are boot time (link/time.h).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "faults/schedule.h"
#include "harness/reference/trajectory.h"
#include "harness/run/arbiter.h"
#include "harness/run/event_limit.h"
#include "harness/run/fault_conditions.h"
#include "harness/run/line.h"
#include "harness/run/message_binding.h"
#include "harness/run/message_order.h"
#include "harness/run/message_range.h"
#include "harness/run/message_receiver.h"
#include "harness/run/record.h"
#include "harness/run/run_log.h"
#include "harness/run/trace.h"
#include "harness/scenario/scenario.h"
#include "link/fields.h"
#include "link/protocol.h"
#include "plant/plant.h"

namespace tiltproof::harness {

class PlantServer {
 public:
  // One frame to send back at once.
  using Reply = std::function<void(std::span<const std::uint8_t> frame)>;
  using SendTo = std::function<void(std::size_t client, std::span<const std::uint8_t> frame)>;

  struct State {
    Origin origin;
    TimeNs reached_ns = 0;                         // simulation time of the last step boundary
    BootTime quiet_until_ns = BootTime::Never();   // until then Advance() has nothing to do
    bool over = false;                             // the vehicle is lost: it diverged or struck the ground
    BootTime next_send_ns = BootTime::Never();     // when the server sends by itself
    EndReason end_reason = EndReason::kCompleted;  // why it is over
    std::string end_text;
    bool started() const { return origin.known(); }
    TILTPROOF_FIELDS(origin, reached_ns, quiet_until_ns, over, next_send_ns, end_reason, end_text)
  };

  virtual ~PlantServer() = default;
  // Steps to the last boundary at or before `to`. A boundary is left, and its row logged with the `counts` of
  // each client's line, only when time has passed it.
  virtual void Advance(BootTime to, const AllCounts& counts) = 0;
  // A client's message whose last byte arrived at `arrival`. The plant has been advanced to that time.
  virtual void Receive(std::size_t client, BootTime arrival, const link::Message& message,
                       const Reply& reply) = 0;
  // Sends what the server sends by itself at `now`, next_send_ns or later: for each client in order, the messages in the
  // order of the protocol. The plant has been advanced to that time. Times that were missed are left out.
  virtual void SendOwn(BootTime now, const SendTo& send) = 0;
  // A client tells this role (ClientRole). The plant has been advanced to the present time.
  virtual void NoteRole(std::size_t client, std::uint32_t role) = 0;
  // Ends the flight at `end`, on the grid or not: writes the last row. Not to be called after it is over.
  virtual void Finish(BootTime end, const AllCounts& counts) = 0;
  virtual const State& state() const = 0;
  // Events for faults that wait, see faults/fault_event.h: up to the time to which the plant has been advanced,
  // conditions included.
  virtual std::vector<faults::FaultEvent> PollEvents() = 0;
  virtual void Hear(std::span<const faults::FaultEvent> events) = 0;
  // Writes the totals; call it once, at the end, whatever ended the flight.
  virtual void WriteTotals() = 0;
};

class LocalPlantServer final : public PlantServer {
 public:
  // `sink`: gets the server's records; it must outlive the server. `use`: of its schedules of faults.
  LocalPlantServer(const Scenario& scenario, const plant::VehicleModel& model, RecordSink& sink,
                   const faults::ScheduleUse& use = {});

  // One more fault of the scenario, while it flies. The rows have no column for it.
  void Add(const faults::FaultSpec& fault);
  // The open fault of the server's use (FaultSchedule::Give).
  void Give(const faults::FaultSpec& fault);
  // The row at the present step boundary, as conditions of faults see it.
  void Look(const AllCounts& counts, std::vector<double>& row) const;

  void Advance(BootTime to, const AllCounts& counts) override;
  void Receive(std::size_t client, BootTime arrival, const link::Message& message,
               const Reply& reply) override;
  void SendOwn(BootTime now, const SendTo& send) override;
  void NoteRole(std::size_t client, std::uint32_t role) override { arbiter_.SetRole(client, role); }
  void Finish(BootTime end, const AllCounts& counts) override;
  const State& state() const override { return state_; }
  std::vector<faults::FaultEvent> PollEvents() override { return std::exchange(news_, {}); }
  void Hear(std::span<const faults::FaultEvent> events) override;
  void WriteTotals() override;
  // Writes what faults did since the last call. WriteTotals() does, too.
  void WriteActivations();

  // For observers, in the order of the vehicle's tables.
  std::vector<double> Truth() const;
  const std::vector<double>& in_force() const { return in_force_; }

 private:
  // The server's state for one client.
  struct ClientPart {
    faults::FaultSchedule faults;       // on the samples sent to this client
    std::vector<double> sensed, asked;  // last sent, and last commanded; NaN before
    std::vector<double> command;        // last commanded; the hover input before
    MessageStamps stamps;               // of the messages sent to it
    std::int64_t starts_accepted_count = 0;
  };
  // A message that the server sends by itself.
  struct OwnMessage {
    const MessageBinding* binding = nullptr;
    BootTime next_ns = BootTime::Never();
  };

  void OnStart(std::size_t client, BootTime arrival, const link::Message& message);
  void AnswerSensorRequest(std::size_t client, BootTime arrival, const link::MessageType& request,
                           const Reply& reply);
  void SampleFor(std::size_t client, BootTime now);
  std::vector<std::uint8_t> FrameFor(std::size_t client, BootTime now, const MessageBinding& message);
  void BeginSending(BootTime now);
  const MessageBinding& BindingOf(const link::MessageType& type) const;
  void AcceptInput(std::size_t client, BootTime arrival, const link::Message& message);
  void PutInputInForce();
  void LeaveBoundary(const AllCounts& counts);
  void LogRow(BootTime at, const AllCounts& counts);
  void FillRow(TimeNs t, const AllCounts& counts, std::span<double> row) const;
  void LookAtConditions();
  void NoteActivations();
  void AddEvent(TimeNs time_ns, std::string kind, std::string text, std::optional<std::size_t> client = {});
  TimeNs SimTime(BootTime t) const { return state_.origin.SimulationTime(t); }

  const Scenario& scenario_;
  VehicleSignals signals_;
  TraceLayout layout_;
  Trajectory trajectory_;
  plant::Plant plant_;
  std::vector<double> readings_;  // of the sensors, before their faults
  std::vector<double> sent_;      // and after them
  faults::FaultSchedule faults_;  // on the vehicle and its actuators
  FaultConditions conditions_;
  std::vector<faults::FaultEvent> news_;
  const link::Protocol& protocol_;
  const link::MessageType& period_message_;
  const bool answers_early_;
  std::vector<MessageBinding> bindings_;  // one per message of the protocol
  std::vector<OwnMessage> own_messages_;
  RangeWatch ranges_;
  OriginFinder origin_;
  Arbiter arbiter_;
  std::vector<ClientPart> clients_;  // one for each client
  State state_;
  RecordSink& sink_;
  Record row_{0, {}, record::Row{}};  // keeps the memory of its values
  EventLimit events_;
  TimeNs logged_ns_ = -1;  // the last row

  // The plant is at this step boundary; `boundary_left_` when nothing more can happen at it.
  BootTime boundary_ns_ = BootTime::Never();
  bool boundary_left_ = false;
  const std::vector<double> hover_input_, input_min_, input_max_;
  std::vector<double> faulted_;   // the arbiter's inputs after the actuator faults
  std::vector<double> in_force_;  // and after the vehicle's limits and its rotors' lag
};

}  // namespace tiltproof::harness
