#include "harness/run/plant_server.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <utility>

#include "harness/run/framed.h"
#include "harness/run/message_binding.h"
#include "link/check.h"

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

constexpr double kNothingYet = std::numeric_limits<double>::quiet_NaN();

std::ptrdiff_t Offset(std::size_t column) { return static_cast<std::ptrdiff_t>(column); }

}  // namespace

LocalPlantServer::LocalPlantServer(const Scenario& scenario, const plant::VehicleModel& model, bool grows)
    : scenario_(scenario),
      signals_(model.signals()),
      layout_(signals_, scenario),
      trajectory_(scenario.reference),
      plant_(model, {.step_ns = scenario.step_ns}),
      readings_(signals_.sensors.size()),
      sent_(signals_.sensors.size()),
      faults_(scenario.faults, scenario.seed,
              {.signals = signals_, .step_ns = scenario.step_ns, .grows = grows}),
      conditions_(scenario, Trace(layout_.columns).columns()),
      protocol_(*scenario.link.protocol),
      arbiter_(scenario) {
  for (const link::MessageType& type : protocol_.messages) bindings_.emplace_back(type, TableOf(type));
  plant_.Reset(scenario.initial_position_m, scenario.initial_attitude_rad);
  for (std::size_t client = 0; client < scenario.client_count(); ++client)
    seats_.push_back({.faults = ClientFaults(scenario, client, &signals_, grows),
                      .sensed = std::vector<double>(signals_.sensors.size(), kNothingYet),
                      .asked = std::vector<double>(signals_.inputs.size(), kNothingYet)});
  log_.clients.resize(seats_.size());
  commanded_ = in_force_ = log_.hover_input = model.HoverInput();
  log_.input_min = model.InputMin();
  log_.input_max = model.InputMax();
  log_.column_count = layout_.columns.size();
  // In real time the log goes out every 50 ms, and giving back what a long flight might fill would take long.
  const auto row_count = static_cast<std::size_t>(scenario.duration_ns / protocol_.control_period_ns) + 2;
  log_.rows.reserve(std::min(row_count, kReservedRowsMax) * layout_.columns.size());
}

void LocalPlantServer::Add(const faults::FaultSpec& fault) {
  faults_.Add(fault);
  for (Seat& seat : seats_) seat.faults.Add(fault);
}

const SignalTable& LocalPlantServer::TableOf(const link::MessageType& type) const {
  switch (type.direction) {
    case link::Direction::kToPlant:
      return signals_.inputs;
    case link::Direction::kToClient:
      return signals_.sensors;
    case link::Direction::kReference:
      break;
  }
  return ReferenceSignals();
}

const MessageBinding& LocalPlantServer::BindingOf(const link::MessageType& type) const {
  return bindings_[static_cast<std::size_t>(&type - protocol_.messages.data())];
}

void LocalPlantServer::Receive(std::size_t client, BootTime arrival, const link::Message& message,
                               const Reply& reply) {
  if (message.type->starts) OnStart(client, arrival, message);
  if (!state_.started() && !protocol_.answers_before_start) return;
  if (!message.type->reply.empty())
    AnswerSensorRequest(client, arrival, *protocol_.Find(message.type->reply), reply);
  if (!message.values.empty() && state_.started()) TakeInput(client, arrival, message);
}

void LocalPlantServer::OnStart(std::size_t client, BootTime arrival, const link::Message& message) {
  std::int64_t& starts_count = log_.clients.at(client).starts_accepted_count;
  if (!state_.started() && !arbiter_.Takes(client)) {
    starts_count = 1;  // it waits for t = 0
  } else if (origin_.Note(arrival, message)) {
    ++starts_count;
    state_.origin = origin_.origin();
    boundary_ns_ = state_.quiet_until_ns = arrival;
    faults_.SetOrigin(state_.origin);
    for (Seat& seat : seats_) seat.faults.SetOrigin(state_.origin);
    events_.Add(0, "start_accepted", "t = 0");
    NoteActivations();
    LookAtConditions();
  } else if (starts_count == 0) {
    ++starts_count;
  } else if (protocol_.repeated_start_is_boot) {
    ++starts_count;
    events_.Add(SimTime(arrival), kStartRepeatedEvent, "the client sent `start` again: it restarted", client);
  }
}

void LocalPlantServer::AnswerSensorRequest(std::size_t client, BootTime arrival,
                                           const link::MessageType& answer, const Reply& reply) {
  const TimeNs sampled = state_.started() ? SimTime(boundary_ns_) : kPowerOn;
  plant_.ReadSensors(readings_, FrameOf(scenario_.angular_rates));
  std::transform(readings_.begin(), readings_.end(), sent_.begin(),
                 [](double value) { return static_cast<float>(value); });
  Seat& seat = seats_[client];
  seat.faults.EditSensors(sampled, sent_, arrival);
  NoteActivations();
  std::copy(sent_.begin(), sent_.end(), seat.sensed.begin());
  reply(Framed(protocol_.Encode(answer, BindingOf(answer).Values<float>(sent_)).span()).bytes());
  if (state_.started()) log_.clients[client].request_times_ns.push_back(SimTime(arrival));
}

void LocalPlantServer::TakeInput(std::size_t client, BootTime arrival, const link::Message& message) {
  log_.clients[client].actuator_times_ns.push_back(SimTime(arrival));
  BindingOf(*message.type).Put(message.values, seats_[client].asked);
  if (!arbiter_.Takes(client)) return;
  BindingOf(*message.type).Put(message.values, commanded_);
  commanded_from_ns_ = arrival <= boundary_ns_ ? boundary_ns_ : boundary_ns_ + scenario_.step_ns;
}

void LocalPlantServer::Advance(BootTime to, const AllCounts& counts) {
  if (!state_.started()) return;
  while (to > boundary_ns_ && !state_.over) {
    if (!boundary_left_) LeaveBoundary(counts);
    state_.quiet_until_ns = boundary_ns_ + scenario_.step_ns - 1;
    if (boundary_ns_ + scenario_.step_ns > to) return;
    Check(boundary_left_, "an input is in force before the step");
    const Disturbance disturbance = faults_.DisturbanceOf(SimTime(boundary_ns_));
    if (!scenario_.held) plant_.Step(in_force_, disturbance);
    boundary_ns_ += scenario_.step_ns;
    boundary_left_ = false;
    state_.quiet_until_ns = boundary_ns_;
    state_.reached_ns = SimTime(boundary_ns_);
    if (const plant::FlightEvent event = plant_.Event();
        event != plant::FlightEvent::kNone && !scenario_.held) {
      state_.over = true;
      state_.end_reason =
          event == plant::FlightEvent::kGroundStrike ? EndReason::kGroundStrike : EndReason::kDiverged;
      state_.end_text = plant_.EventText();
      events_.Add(state_.reached_ns, std::string(Name(state_.end_reason)), state_.end_text);
    }
    NoteActivations();
    LookAtConditions();
  }
}

// Before anything else happens at this boundary.
void LocalPlantServer::LookAtConditions() {
  if (conditions_.empty() || SimTime(boundary_ns_) % protocol_.control_period_ns != 0) return;
  std::vector<double> row(layout_.columns.size(), std::numeric_limits<double>::quiet_NaN());
  FillRow(SimTime(boundary_ns_), AllCounts(seats_.size()), row);
  std::vector<faults::News> news;
  conditions_.Look(SimTime(boundary_ns_), row, news);
  Hear(news);
  news_.insert(news_.end(), news.begin(), news.end());
}

void LocalPlantServer::Hear(std::span<const faults::News> news) {
  faults_.Hear(news);
  for (Seat& seat : seats_) seat.faults.Hear(news);
}

void LocalPlantServer::NoteActivations() {
  std::vector<faults::FaultSchedule*> all = {&faults_};
  for (Seat& seat : seats_) all.push_back(&seat.faults);
  for (faults::FaultSchedule* from : all) {
    const std::vector<faults::News> news = from->TakeNews();
    if (news.empty()) continue;
    for (faults::FaultSchedule* other : all)
      if (other != from) other->Hear(news);
    news_.insert(news_.end(), news.begin(), news.end());
  }
}

void LocalPlantServer::Finish(BootTime end, const AllCounts& counts) {
  if (!boundary_left_) PutInputInForce();
  LogRow(end, counts);
}

std::vector<double> LocalPlantServer::Truth() const {
  std::vector<double> state(signals_.states.size());
  plant_.State(state);
  return state;
}

void LocalPlantServer::PutInputInForce() {
  const TimeNs t = SimTime(boundary_ns_);
  const bool new_command = commanded_from_ns_ <= boundary_ns_;
  if (new_command) commanded_from_ns_ = BootTime::Never();
  in_force_ = commanded_;
  faults_.EditInput(t, in_force_, new_command);
  plant_.Saturate(in_force_);
  NoteActivations();
}

void LocalPlantServer::LeaveBoundary(const AllCounts& counts) {
  boundary_left_ = true;
  PutInputInForce();
  if (SimTime(boundary_ns_) % protocol_.control_period_ns == 0) LogRow(boundary_ns_, counts);
}

void LocalPlantServer::LogRow(BootTime at, const AllCounts& counts) {
  const TimeNs t = SimTime(at);
  const std::size_t begin = log_.rows.size();
  Check(logged_ns_ < t, "rows are logged in order of time, each once");
  logged_ns_ = t;
  log_.rows.resize(begin + layout_.columns.size(), std::numeric_limits<double>::quiet_NaN());
  FillRow(t, counts, std::span(log_.rows).subspan(begin));
  if (watcher_ != nullptr) watcher_->on_row(std::span(log_.rows).subspan(begin));
}

// `row` holds NaN.
void LocalPlantServer::FillRow(TimeNs t, const AllCounts& counts, std::span<double> row) const {
  row[0] = ToSeconds(t);
  plant_.State(row.subspan(layout_.states, signals_.states.size()));
  std::copy(in_force_.begin(), in_force_.end(), row.begin() + Offset(layout_.inputs));
  const ReferencePoint reference = trajectory_.At(t);
  std::copy_n(reference.position_m.begin(), 3, row.begin() + Offset(layout_.reference));
  row[layout_.reference + 3] = reference.yaw_rad;
  for (std::size_t client = 0; client < seats_.size(); ++client) {
    const auto& [faults, sensed, asked] = seats_[client];
    std::copy(sensed.begin(), sensed.end(), row.begin() + Offset(layout_.sensed + client * sensed.size()));
    std::copy(asked.begin(), asked.end(), row.begin() + Offset(layout_.commanded + client * asked.size()));
  }
  if (layout_.arbiter_selected) row[*layout_.arbiter_selected] = static_cast<double>(arbiter_.selected());
  std::size_t column = layout_.link_counters;
  for (const LineCounts& line : counts)
    for (const DirectionCounts& count : line)
      for (const std::int64_t value : {count.frames_sent, count.frames_accepted, count.frames_rejected})
        row[column++] = static_cast<double>(value);
  double& active_count = row[layout_.faults_active_count] = 0;
  for (std::size_t i = 0; i < layout_.watch - layout_.active; ++i) {
    const double active = row[layout_.active + i] = faults_.IsActive(i, t) ? 1.0 : 0.0;
    active_count += active;
  }
}

PlantLog LocalPlantServer::TakeLog() {
  PlantLog log = std::exchange(log_, {});
  log_.hover_input = log.hover_input;
  log_.input_min = log.input_min;
  log_.input_max = log.input_max;
  log_.column_count = log.column_count;
  log_.clients.resize(log.clients.size());
  for (std::size_t i = 0; i < log.clients.size(); ++i)
    log_.clients[i].starts_accepted_count = log.clients[i].starts_accepted_count;
  log.events = events_.Take();
  log.activations = faults_.TakeActivations(state_.origin);
  log.activation_counts = faults_.ActivationCounts();
  for (Seat& seat : seats_) {
    const auto& counts = seat.faults.ActivationCounts();
    for (std::size_t i = 0; i < counts.size(); ++i) log.activation_counts[i] += counts[i];
    for (auto& activation : seat.faults.TakeActivations(state_.origin))
      log.activations.push_back(std::move(activation));
  }
  return log;
}

}  // namespace tiltproof::harness
