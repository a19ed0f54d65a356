#include "harness/run/flight.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <deque>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include "faults/schedule.h"
#include "harness/client/firmware_guard.h"
#include "harness/reference/trajectory.h"
#include "harness/run/hash.h"
#include "harness/run/receiving_end.h"
#include "link/frame.h"
#include "link/messages.h"
#include "link/wire.h"
#include "plant/plant.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

constexpr std::size_t kEventsMax = 10'000;
constexpr std::size_t kFirmwareLogBytesMax = 1 << 20;
constexpr std::size_t kRepliesMax = 256;
// A client may say that it transmits later within its call, but not by more than this.
constexpr TimeNs kTransmitAheadMax = kNsPerS;
// A client that asks to be woken at the present instant this often in a row will never let time pass.
constexpr int kTurnsAtOneInstantMax = 1000;

constexpr std::size_t Index(Direction direction) { return static_cast<std::size_t>(direction); }

plant::RatesFrame FrameOf(AngularRates rates) {
  switch (rates) {
    case AngularRates::kWorld:
      return plant::RatesFrame::kWorld;
    case AngularRates::kBody:
      return plant::RatesFrame::kBody;
    case AngularRates::kEuler:
      return plant::RatesFrame::kEuler;
  }
  return plant::RatesFrame::kWorld;
}

std::int64_t MainBaud(const LinkSpec& link) { return link.ideal ? 0 : link.baud; }
// The second serial line keeps the paper's rate whatever the first one's is.
std::int64_t ReferenceBaud(const LinkSpec& link) { return link.ideal ? 0 : 921'600; }

std::vector<std::string> ColumnsOf(const Scenario& scenario) {
  std::vector<std::string> columns = TraceColumns();
  for (const auto& fault : scenario.faults) columns.push_back("active_" + fault.id);
  return columns;
}

// Times inside are boot time (nanoseconds since the client's power-on); what goes to the log is turned into
// simulation time.
class Flight {
 public:
  Flight(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options);
  RunLog Run();

 private:
  void Conduct();
  void ServePlantEnd(TimeNs now);
  bool DeliverToClient(TimeNs now);
  void OnClientMessage(TimeNs arrival, std::span<const std::uint8_t> payload);
  void OnStart(TimeNs arrival);
  void AnswerSensorRequest(TimeNs arrival);
  void LogReplyLatency(TimeNs arrival, std::span<const std::uint8_t> payload);
  void SendReference(TimeNs now);

  void AdvancePlant(TimeNs to);
  void PutInputInForce();
  void LeaveBoundary();
  void LogRow(TimeNs at);
  void Finish();

  bool started() const { return origin_ns_ != kNever; }
  TimeNs SimTime(TimeNs boot_time) const { return boot_time - origin_ns_; }
  void LogEvent(TimeNs boot_time, std::string kind, std::string text);
  void LogRejection(TimeNs arrival, Direction direction, std::string_view reason);

  const Scenario& scenario_;
  const FlightOptions& options_;
  RunLog log_;

  Trajectory trajectory_;
  plant::Plant plant_;
  faults::FaultSchedule faults_;
  std::array<link::Wire, link::kDirectionCount> wires_;
  std::array<ReceivingEnd, link::kDirectionCount> ends_;
  std::unique_ptr<Client> client_;

  TimeNs origin_ns_ = kNever;  // boot time of t = 0
  TimeNs wake_ns_ = 0;         // until when the client waits
  TimeNs next_reference_ns_ = kNever;
  bool over_ = false;

  // The plant stands at this step boundary; `boundary_left_` when nothing more can happen at it.
  TimeNs boundary_ns_ = kNever;
  bool boundary_left_ = false;
  ActuatorsTruth commanded_;           // last accepted, or the hover input
  TimeNs commanded_from_ns_ = kNever;  // boundary at which it takes force; kNever when it has
  TimeNs next_fault_edge_ns_ = kPowerOn;
  ActuatorsTruth in_force_;  // commanded_ after the actuator faults
  std::optional<Sensors> sensed_;
  std::optional<Actuators> asked_;
  // Payloads of the replies on their way, by hash, with the arrival of the request that each answers.
  struct Reply {
    std::uint64_t payload_hash;
    TimeNs requested_ns;
  };
  std::deque<Reply> replies_;
  std::vector<std::pair<TimeNs, std::string>> firmware_lines_;  // what the firmware logged, in boot time
  std::size_t firmware_log_bytes_ = 0;
  TimeNs now_ns_ = 0;  // of the turn under way
};

Flight::Flight(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options)
    : scenario_(scenario),
      options_(options),
      trajectory_(scenario.reference),
      plant_(model, {.step_ns = scenario.step_ns}),
      faults_(scenario.faults, scenario.seed,
              {.baud = MainBaud(scenario.link), .reference_baud = ReferenceBaud(scenario.link)}),
      wires_{[&] {
        const auto wire = [&](Direction direction, TimeNs latency) {
          const bool main = direction != Direction::kReference;
          return link::Wire({.baud = main ? MainBaud(scenario.link) : ReferenceBaud(scenario.link),
                             .adapter_latency_ns = latency},
                            direction, scenario.link.dialect, faults_.Stage(direction));
        };
        // The adapter's receive buffer stands between the firmware and the server; the other way it sends at
        // once.
        return std::array{wire(Direction::kToPlant, FromSeconds(scenario.link.adapter_latency_ms * 1e-3)),
                          wire(Direction::kToClient, 0), wire(Direction::kReference, 0)};
      }()},
      ends_{ReceivingEnd(Direction::kToPlant, scenario.link.dialect,
                         faults_.Stage(Direction::kToPlant) != nullptr),
            ReceivingEnd(Direction::kToClient, scenario.link.dialect,
                         faults_.Stage(Direction::kToClient) != nullptr),
            ReceivingEnd(Direction::kReference, scenario.link.dialect,
                         faults_.Stage(Direction::kReference) != nullptr)} {
  log_.trace = Trace(ColumnsOf(scenario));
  log_.trace.Reserve(static_cast<std::size_t>(scenario.duration_ns / kControlPeriodNs) + 1);
  plant_.Reset(scenario.initial_position_m, scenario.initial_attitude_rad);
  commanded_ = model.HoverInput();
  for (std::size_t i = 0; i < kActuatorCount; ++i) {
    const auto field = kActuatorFields[i].in_double;
    log_.hover_input[i] = commanded_.*field;
    log_.input_min[i] = model.InputMin().*field;
    log_.input_max[i] = model.InputMax().*field;
  }

  for (std::size_t d = 0; d < link::kDirectionCount; ++d) {
    const auto direction = static_cast<Direction>(d);
    wires_[d].SetTaps({.sent =
                           [this, d, direction](const link::Chunk& chunk) {
                             log_.link.Append(chunk, direction, false);
                             ends_[d].OnSent(chunk);
                           },
                       .delivered =
                           [this, d, direction](const link::Chunk& chunk) {
                             log_.link.Append(chunk, direction, true);
                             ends_[d].OnDelivered(chunk);
                           }});
  }

  client_ = options.make_client(
      {.transmit = [this](Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) -> TimeNs {
         // The reference line has no way back: what the client sends there ends at its pin.
         if (uart != Uart::kMain) return now;
         return wires_[Index(Direction::kToPlant)].Transmit(
             std::clamp(now, now_ns_, now_ns_ + kTransmitAheadMax), bytes);
       },
       .log =
           [this](TimeNs now, std::string_view text) {
             if (firmware_log_bytes_ > kFirmwareLogBytesMax) return;
             firmware_log_bytes_ += text.size();
             firmware_lines_.emplace_back(now, text);
           }});
}

RunLog Flight::Run() {
  const auto began = std::chrono::steady_clock::now();
  try {
    Conduct();
  } catch (const FirmwareTrouble& trouble) {
    log_.end_reason = trouble.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed;
    log_.end_text = trouble.what();
  } catch (const std::exception& error) {
    log_.end_reason = EndReason::kHarnessError;
    log_.end_text = error.what();
  }
  log_.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  Finish();
  return std::move(log_);
}

void Flight::Conduct() {
  TimeNs last = kPowerOn;
  int turns = 0;
  wake_ns_ = client_->Start(0);
  for (;;) {
    const TimeNs end = (started() ? origin_ns_ : 0) + scenario_.duration_ns;
    TimeNs now = std::min(wake_ns_, next_reference_ns_);
    for (const auto& wire : wires_) now = std::min(now, wire.NextArrival());
    now = std::max(now, last);
    if (now > end) {
      if (started()) {
        AdvancePlant(end);
        // The last row is at duration_s, on the grid or not.
        if (!over_) LogRow(end);
      } else {
        log_.end_reason = EndReason::kNeverStarted;
        log_.end_text = "the server accepted no `start` message within " +
                        std::to_string(ToSeconds(scenario_.duration_ns)) + " s of power-on";
      }
      return;
    }
    turns = now == last ? turns + 1 : 0;
    last = now_ns_ = now;
    if (turns > kTurnsAtOneInstantMax)
      throw FirmwareTrouble(true, "the firmware lets no time pass: it wants to be woken at " +
                                      std::to_string(now) + " ns again and again");
    if (options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed)) {
      log_.end_reason = EndReason::kInterrupted;
      log_.end_text = "interrupted";
      return;
    }

    // First of all, so that rows of the past show nothing of what happens now.
    if (started()) AdvancePlant(now);
    if (over_) return;
    if (now == next_reference_ns_) SendReference(now);
    ServePlantEnd(now);
    if (DeliverToClient(now) || now >= wake_ns_) wake_ns_ = client_->Grant(now);
  }
}

// The server: every accepted message of the client in order of arrival (paper, Figure 5).
void Flight::ServePlantEnd(TimeNs now) {
  auto& wire = wires_[Index(Direction::kToPlant)];
  if (wire.NextArrival() > now) return;
  wire.Take(now, [this](TimeNs arrival, std::span<const std::uint8_t> bytes) {
    ends_[Index(Direction::kToPlant)].Receive(
        arrival, bytes,
        [this](TimeNs at, std::span<const std::uint8_t> payload) { OnClientMessage(at, payload); },
        [this](TimeNs at, std::string_view reason) { LogRejection(at, Direction::kToPlant, reason); });
  });
}

// The client gets every byte that has arrived, whole frame or not: it may flush what it holds at any tick.
bool Flight::DeliverToClient(TimeNs now) {
  bool delivered = false;
  // References first: r(t_k) is there before the sensor reply of the same period.
  for (const Direction direction : {Direction::kReference, Direction::kToClient}) {
    const Uart uart = direction == Direction::kReference ? Uart::kReference : Uart::kMain;
    wires_[Index(direction)].Take(now, [&](TimeNs arrival, std::span<const std::uint8_t> bytes) {
      delivered = true;
      client_->Receive(uart, arrival, bytes);
      ends_[Index(direction)].Receive(
          arrival, bytes,
          [&](TimeNs at, std::span<const std::uint8_t> payload) {
            if (direction == Direction::kToClient) LogReplyLatency(at, payload);
          },
          [&](TimeNs at, std::string_view reason) { LogRejection(at, direction, reason); });
    });
  }
  return delivered;
}

// Late, repeated and lost replies are told apart by what they say; the newest that says it is the one meant.
void Flight::LogReplyLatency(TimeNs arrival, std::span<const std::uint8_t> payload) {
  const std::uint64_t hash = Fnv1a(payload);
  const auto found = std::find_if(replies_.rbegin(), replies_.rend(),
                                  [&](const Reply& reply) { return reply.payload_hash == hash; });
  if (found == replies_.rend()) return;
  log_.reply_latency_ns.push_back(arrival - found->requested_ns);
  replies_.erase(std::next(found).base());
}

void Flight::OnClientMessage(TimeNs arrival, std::span<const std::uint8_t> payload) {
  link::ClientMessage message;
  if (link::DecodeClientMessage(scenario_.link.dialect, payload, message) != link::MessageStatus::kOk) return;
  if (message.start) OnStart(arrival);
  // The paper's server answers nothing before `start`; the authors' one shows its standing vehicle.
  if (!started() && scenario_.link.dialect == link::Dialect::kPaper) return;
  if (message.read_sensors) AnswerSensorRequest(arrival);
  if (message.has_actuators && started()) {
    asked_ = message.actuators;
    commanded_ = ToDouble(message.actuators, kActuatorFields);
    commanded_from_ns_ = arrival <= boundary_ns_ ? boundary_ns_ : boundary_ns_ + scenario_.step_ns;
    log_.actuator_times_ns.push_back(SimTime(arrival));
  }
}

void Flight::OnStart(TimeNs arrival) {
  // In `provant` every id 3 says un-pause; only the paper's `start` again means that the firmware began anew.
  if (started()) {
    if (scenario_.link.dialect == link::Dialect::kPaper) {
      ++log_.starts_accepted_count;
      LogEvent(arrival, "start_repeated", "the client sent `start` again: it began anew");
    }
    return;
  }
  ++log_.starts_accepted_count;
  origin_ns_ = arrival;
  boundary_ns_ = arrival;
  faults_.SetOrigin(arrival);
  LogEvent(arrival, "start_accepted", "t = 0");
  SendReference(arrival);
}

void Flight::AnswerSensorRequest(TimeNs arrival) {
  const TimeNs sampled = started() ? SimTime(boundary_ns_) : kPowerOn;
  Sensors sensors = ToFloat(plant_.ReadSensors(FrameOf(scenario_.angular_rates)), kSensorFields);
  faults_.EditSensors(sampled, sensors);
  sensed_ = sensors;
  const link::MessageBytes message = link::EncodeSensors(sensors);
  std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> frame;
  wires_[Index(Direction::kToClient)].Transmit(arrival, link::EncodeFrame(message.span(), frame).bytes);
  if (!started()) return;
  log_.request_times_ns.push_back(SimTime(arrival));
  if (replies_.size() == kRepliesMax) replies_.pop_front();
  replies_.push_back({Fnv1a(message.span()), arrival});
}

// The base station follows the simulation's clock (paper, section 2.2, Figure 6).
void Flight::SendReference(TimeNs now) {
  const link::MessageBytes message =
      link::EncodeReference(ToFloat(trajectory_.At(SimTime(now)), kReferenceFields));
  std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> frame;
  wires_[Index(Direction::kReference)].Transmit(now, link::EncodeFrame(message.span(), frame).bytes);
  next_reference_ns_ = now + kControlPeriodNs;
  if (options_.progress_ns != nullptr) options_.progress_ns->store(SimTime(now), std::memory_order_relaxed);
}

// Steps to the last boundary at or before `to`. A boundary is left, and its row logged, only when time has
// passed it.
void Flight::AdvancePlant(TimeNs to) {
  while (to > boundary_ns_ && !over_) {
    if (!boundary_left_) LeaveBoundary();
    if (boundary_ns_ + scenario_.step_ns > to) return;
    plant_.Step(in_force_);
    boundary_ns_ += scenario_.step_ns;
    boundary_left_ = false;
    if (const plant::FlightEvent event = plant_.Event(); event != plant::FlightEvent::kNone) {
      over_ = true;
      log_.end_reason =
          event == plant::FlightEvent::kGroundStrike ? EndReason::kGroundStrike : EndReason::kDiverged;
      log_.end_text = plant_.EventText();
      LogEvent(boundary_ns_, std::string(Name(log_.end_reason)), log_.end_text);
    }
  }
}

void Flight::PutInputInForce() {
  const TimeNs t = SimTime(boundary_ns_);
  const bool new_command = commanded_from_ns_ <= boundary_ns_;
  if (!new_command && t < next_fault_edge_ns_) return;
  if (new_command) commanded_from_ns_ = kNever;
  ActuatorsTruth input = commanded_;
  faults_.EditActuators(t, input, new_command);
  in_force_ = plant_.Saturate(input);
  next_fault_edge_ns_ = faults_.NextEdge(t);
}

void Flight::LeaveBoundary() {
  boundary_left_ = true;
  if (SimTime(boundary_ns_) % kControlPeriodNs == 0) {
    LogRow(boundary_ns_);
  } else {
    PutInputInForce();
  }
}

void Flight::LogRow(TimeNs at) {
  PutInputInForce();
  const TimeNs t = SimTime(at);
  const std::span<double> row = log_.trace.AppendRow();
  std::size_t column = 0;
  const auto put = [&](double value) { row[column++] = value; };
  put(ToSeconds(t));
  const SensorsTruth state = plant_.State();
  for (const auto& field : kSensorFields) put(state.*field.in_double);
  for (const auto& field : kActuatorFields) put(in_force_.*field.in_double);
  const ReferenceTruth reference = trajectory_.At(t);
  put(reference.x_m), put(reference.y_m), put(reference.z_m), put(reference.yaw_rad);
  if (sensed_) {
    for (const auto& field : kSensorFields) put(static_cast<double>((*sensed_).*field.in_float));
  } else {
    column += kSensorCount;  // NaN: none sent yet
  }
  if (asked_) {
    for (const auto& field : kActuatorFields) put(static_cast<double>((*asked_).*field.in_float));
  } else {
    column += kActuatorCount;
  }
  const std::size_t active_count_column = column++;
  for (const auto& end : ends_) {
    put(static_cast<double>(end.counts().frames_sent));
    put(static_cast<double>(end.counts().frames_accepted));
    put(static_cast<double>(end.counts().frames_rejected));
  }
  double active_count = 0;
  for (std::size_t i = 0; i < scenario_.faults.size(); ++i) {
    const double active = faults_.IsActive(i, t) ? 1.0 : 0.0;
    active_count += active;
    put(active);
  }
  row[active_count_column] = active_count;
}

void Flight::Finish() {
  // Without t = 0 there is no simulation time: boot time is shown as if power-on were the origin.
  const TimeNs origin = started() ? origin_ns_ : 0;
  log_.end_ns = !started()                                 ? 0
                : log_.end_reason == EndReason::kCompleted ? scenario_.duration_ns
                                                           : SimTime(boundary_ns_);
  log_.link.ShiftOrigin(origin);
  for (auto& event : log_.events) event.time_ns -= origin;
  for (const auto& [time_ns, text] : firmware_lines_)
    log_.firmware_log += fmt::format("{:.6f} {}\n", ToSeconds(time_ns - origin), text);
  for (std::size_t d = 0; d < link::kDirectionCount; ++d) {
    log_.counts[d] = ends_[d].counts();
    log_.resync_max_ns = std::max(log_.resync_max_ns, ends_[d].ResyncMax(origin + log_.end_ns));
    log_.accepted_wrong_count += ends_[d].wrong_count();
    log_.accepted_stale_count += ends_[d].stale_count();
  }
  log_.fault_activation_counts = faults_.ActivationCounts();
  log_.activations = faults_.TakeActivations(origin);
  if (log_.end_reason != EndReason::kFirmwareHung && log_.end_reason != EndReason::kFirmwareCrashed) {
    try {
      if (const auto status = client_->Status()) log_.failsafe_entered_count = status->failsafe_count;
    } catch (const FirmwareTrouble& trouble) {
      log_.end_reason = trouble.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed;
      log_.end_text = trouble.what();
    }
  }
}

void Flight::LogEvent(TimeNs boot_time, std::string kind, std::string text) {
  if (log_.events.size() > kEventsMax) return;
  if (log_.events.size() == kEventsMax) {
    kind = "events_suppressed";
    text = "more than " + std::to_string(kEventsMax) + " events: the rest is counted in the metrics only";
  }
  log_.events.push_back({boot_time, std::move(kind), std::move(text)});
}

void Flight::LogRejection(TimeNs arrival, Direction direction, std::string_view reason) {
  LogEvent(arrival, "rejected", std::string(Name(direction)) + ": " + std::string(reason));
}

}  // namespace

RunLog Fly(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options) {
  return Flight(scenario, model, options).Run();
}

}  // namespace tiltproof::harness
