#include "harness/run/plant_server.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "harness/run/framed.h"
#include "link/messages.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kReservedRowsMax = 10'000;  // two minutes

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

}  // namespace

std::vector<std::string> FlightColumns(const Scenario& scenario) {
  std::vector<std::string> columns = TraceColumns();
  for (const auto& fault : scenario.faults) columns.push_back("active_" + fault.id);
  return columns;
}

LocalPlantServer::LocalPlantServer(const Scenario& scenario, const plant::VehicleModel& model)
    : scenario_(scenario),
      trajectory_(scenario.reference),
      plant_(model, {.step_ns = scenario.step_ns}),
      faults_(scenario.faults, scenario.seed),
      column_count_(FlightColumns(scenario).size()) {
  plant_.Reset(scenario.initial_position_m, scenario.initial_attitude_rad);
  commanded_ = model.HoverInput();
  for (std::size_t i = 0; i < kActuatorCount; ++i) {
    const auto field = kActuatorFields[i].in_double;
    log_.hover_input[i] = commanded_.*field;
    log_.input_min[i] = model.InputMin().*field;
    log_.input_max[i] = model.InputMax().*field;
  }
  // In real time the log goes out every 50 ms, and giving back what a long flight might fill would take long.
  const auto row_count = static_cast<std::size_t>(scenario.duration_ns / kControlPeriodNs) + 2;
  log_.rows.reserve(std::min(row_count, kReservedRowsMax) * column_count_);
}

// Every accepted message of the client in order of arrival.
void LocalPlantServer::Receive(TimeNs arrival, std::span<const std::uint8_t> bytes, const Reply& reply) {
  while (const auto event = decoder_.Next(bytes))
    if (event->status == link::FrameStatus::kOk) OnClientMessage(arrival, event->payload, reply);
}

void LocalPlantServer::OnClientMessage(TimeNs arrival, std::span<const std::uint8_t> payload,
                                       const Reply& reply) {
  link::ClientMessage message;
  if (link::DecodeClientMessage(scenario_.link.dialect, payload, message) != link::MessageStatus::kOk) return;
  if (message.start) OnStart(arrival);
  // The paper's server answers nothing before `start`; the authors' one shows its standing vehicle.
  if (!state_.started() && scenario_.link.dialect == link::Dialect::kPaper) return;
  if (message.read_sensors) AnswerSensorRequest(arrival, reply);
  if (message.has_actuators && state_.started()) {
    asked_ = message.actuators;
    commanded_ = ToDouble(message.actuators, kActuatorFields);
    commanded_from_ns_ = arrival <= boundary_ns_ ? boundary_ns_ : boundary_ns_ + scenario_.step_ns;
    log_.actuator_times_ns.push_back(SimTime(arrival));
  }
}

void LocalPlantServer::OnStart(TimeNs arrival) {
  // In `provant` every id 3 says un-pause; only the paper's `start` again means that the firmware began anew.
  if (state_.started()) {
    if (scenario_.link.dialect == link::Dialect::kPaper) {
      ++log_.starts_accepted_count;
      events_.Add(SimTime(arrival), "start_repeated", "the client sent `start` again: it began anew");
    }
    return;
  }
  ++log_.starts_accepted_count;
  state_.origin_ns = arrival;
  boundary_ns_ = state_.quiet_until_ns = arrival;
  faults_.SetOrigin(arrival);
  events_.Add(0, "start_accepted", "t = 0");
}

void LocalPlantServer::AnswerSensorRequest(TimeNs arrival, const Reply& reply) {
  const TimeNs sampled = state_.started() ? SimTime(boundary_ns_) : kPowerOn;
  Sensors sensors = ToFloat(plant_.ReadSensors(FrameOf(scenario_.angular_rates)), kSensorFields);
  faults_.EditSensors(sampled, sensors, arrival);
  sensed_ = sensors;
  reply(Framed(link::EncodeSensors(sensors)).bytes());
  if (state_.started()) log_.request_times_ns.push_back(SimTime(arrival));
}

void LocalPlantServer::Advance(TimeNs to, const LineCounts& counts) {
  if (!state_.started()) return;
  while (to > boundary_ns_ && !state_.over) {
    if (!boundary_left_) LeaveBoundary(counts);
    state_.quiet_until_ns = boundary_ns_ + scenario_.step_ns - 1;
    if (boundary_ns_ + scenario_.step_ns > to) return;
    plant_.Step(in_force_);
    boundary_ns_ += scenario_.step_ns;
    boundary_left_ = false;
    state_.quiet_until_ns = boundary_ns_;
    state_.reached_ns = SimTime(boundary_ns_);
    if (const plant::FlightEvent event = plant_.Event(); event != plant::FlightEvent::kNone) {
      state_.over = true;
      state_.end_reason =
          event == plant::FlightEvent::kGroundStrike ? EndReason::kGroundStrike : EndReason::kDiverged;
      state_.end_text = plant_.EventText();
      events_.Add(state_.reached_ns, std::string(Name(state_.end_reason)), state_.end_text);
    }
  }
}

void LocalPlantServer::Finish(TimeNs end, const LineCounts& counts) { LogRow(end, counts); }

void LocalPlantServer::PutInputInForce() {
  const TimeNs t = SimTime(boundary_ns_);
  const bool new_command = commanded_from_ns_ <= boundary_ns_;
  if (!new_command && t < next_fault_edge_ns_) return;
  if (new_command) commanded_from_ns_ = kNever;
  ActuatorsTruth input = commanded_;
  faults_.EditActuators(t, input, new_command);
  in_force_ = plant_.Saturate(input);
  next_fault_edge_ns_ = faults_.NextEdge(t);
}

void LocalPlantServer::LeaveBoundary(const LineCounts& counts) {
  boundary_left_ = true;
  if (SimTime(boundary_ns_) % kControlPeriodNs == 0) {
    LogRow(boundary_ns_, counts);
  } else {
    PutInputInForce();
  }
}

void LocalPlantServer::LogRow(TimeNs at, const LineCounts& counts) {
  PutInputInForce();
  const TimeNs t = SimTime(at);
  const std::size_t begin = log_.rows.size();
  log_.rows.resize(begin + column_count_, std::numeric_limits<double>::quiet_NaN());
  const std::span<double> row = std::span(log_.rows).subspan(begin);
  std::size_t column = 0;
  const auto put = [&](double value) { row[column++] = value; };
  put(ToSeconds(t));
  const SensorsTruth truth = plant_.State();
  for (const auto& field : kSensorFields) put(truth.*field.in_double);
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
  for (const auto& count : counts) {
    put(static_cast<double>(count.frames_sent));
    put(static_cast<double>(count.frames_accepted));
    put(static_cast<double>(count.frames_rejected));
  }
  double active_count = 0;
  for (std::size_t i = 0; i < scenario_.faults.size(); ++i) {
    const double active = faults_.IsActive(i, t) ? 1.0 : 0.0;
    active_count += active;
    put(active);
  }
  row[active_count_column] = active_count;
}

PlantLog LocalPlantServer::TakeLog() {
  PlantLog log = std::exchange(log_, {});
  log_.hover_input = log.hover_input;
  log_.input_min = log.input_min;
  log_.input_max = log.input_max;
  log_.starts_accepted_count = log.starts_accepted_count;
  log.events = events_.Take();
  log.activations = faults_.TakeActivations(state_.started() ? state_.origin_ns : 0);
  log.activation_counts = faults_.ActivationCounts();
  return log;
}

}  // namespace tiltproof::harness
