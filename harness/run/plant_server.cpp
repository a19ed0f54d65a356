#include "harness/run/plant_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "faults/random.h"
#include "harness/run/message_binding.h"
#include "harness/run/vehicle_start.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

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

// The draws of sensors' noise: each signal and part has a stream of the scenario's seed.
plant::SensorDraws DrawsOf(const SignalTable& measured, std::uint64_t seed) {
  static constexpr std::array<std::string_view, 3> kParts = {"white", "bias", "walk"};
  std::vector<std::array<std::uint64_t, 3>> streams;
  for (const Signal& signal : measured) {
    std::array<std::uint64_t, 3>& of_signal = streams.emplace_back();
    for (std::size_t i = 0; i < kParts.size(); ++i)
      of_signal[i] = faults::StreamKey(seed, {"sensor", signal.name, kParts[i]});
  }
  return [streams](std::size_t signal, plant::NoisePart part, std::uint64_t number) {
    return faults::Random(faults::KeyOf(streams.at(signal).at(static_cast<std::size_t>(part)), number))
        .StandardNormal();
  };
}

plant::PlantOptions OptionsOf(const Scenario& scenario, const VehicleSignals& signals) {
  plant::PlantOptions options = PlantOptionsOf(scenario);
  if (scenario.sensor_noise) options.sensor_draws = DrawsOf(signals.measured, scenario.seed);
  return options;
}

// A client whose first command is t = 0 needs the sensors before.
bool AnswersBeforeStart(const link::Protocol& protocol) {
  return protocol.answers_before_start ||
         std::any_of(protocol.messages.begin(), protocol.messages.end(), [](const link::MessageType& type) {
           return type.starts && type.kind == link::MessageKind::kActuators;
         });
}

std::ptrdiff_t Offset(std::size_t column) { return static_cast<std::ptrdiff_t>(column); }

}  // namespace

LocalPlantServer::LocalPlantServer(const Scenario& scenario, const plant::VehicleModel& model,
                                   RecordSink& sink, const faults::ScheduleUse& use)
    : scenario_(scenario),
      signals_(model.signals()),
      layout_(signals_, scenario),
      trajectory_(scenario.reference),
      plant_(model, OptionsOf(scenario, signals_)),
      readings_(signals_.sensors.size()),
      sent_(signals_.sensors.size()),
      faults_(
          scenario.faults, scenario.seed,
          {.protocol = scenario.link.protocol, .signals = signals_, .step_ns = scenario.step_ns, .use = use}),
      conditions_(scenario, Trace(layout_.columns).columns()),
      protocol_(*scenario.link.protocol),
      period_message_(protocol_.PeriodMessage()),
      answers_early_(AnswersBeforeStart(protocol_)),
      ranges_(protocol_),
      arbiter_(scenario, {model.HoverInput(), model.InputMin(), model.InputMax()}),
      sink_(sink),
      hover_input_(model.HoverInput()),
      input_min_(model.InputMin()),
      input_max_(model.InputMax()),
      faulted_(hover_input_),
      in_force_(hover_input_) {
  for (const link::MessageType& type : protocol_.messages)
    bindings_.emplace_back(protocol_, type, TableOf(type, signals_), scenario.angular_rates);
  for (const MessageBinding& binding : bindings_)
    if (binding.type().period_ns > 0) own_messages_.push_back({&binding});
  PlaceAtStart(scenario, plant_);
  for (std::size_t client = 0; client < scenario.client_count(); ++client)
    clients_.push_back({.faults = ClientFaults(scenario, client, &signals_, use),
                        .sensed = std::vector<double>(signals_.sensors.size(), kNothingYet),
                        .asked = std::vector<double>(signals_.inputs.size(), kNothingYet),
                        .command = hover_input_,
                        .stamps = MessageStamps(protocol_)});
  if (answers_early_) BeginSending(BootTime());
}

void LocalPlantServer::Add(const faults::FaultSpec& fault) {
  faults_.Add(fault);
  for (ClientPart& own : clients_) own.faults.Add(fault);
}

void LocalPlantServer::Give(const faults::FaultSpec& fault) {
  faults_.Give(fault);
  for (ClientPart& own : clients_) own.faults.Give(fault);
}

const MessageBinding& LocalPlantServer::BindingOf(const link::MessageType& type) const {
  return bindings_[static_cast<std::size_t>(&type - protocol_.messages.data())];
}

void LocalPlantServer::Receive(std::size_t client, BootTime arrival, const link::Message& message,
                               const Reply& reply) {
  if (message.type->starts) OnStart(client, arrival, message);
  if (!state_.started() && !answers_early_) return;
  if (!message.type->reply.empty()) AnswerSensorRequest(client, arrival, *message.type, reply);
  if (message.type->has_signals() && state_.started()) AcceptInput(client, arrival, message);
}

void LocalPlantServer::OnStart(std::size_t client, BootTime arrival, const link::Message& message) {
  std::int64_t& starts_count = clients_.at(client).starts_accepted_count;
  if (!state_.started() && !arbiter_.MakesOrigin(client)) {
    starts_count = 1;  // it waits for t = 0
  } else if (origin_.Note(arrival, message)) {
    ++starts_count;
    state_.origin = origin_.origin();
    boundary_ns_ = state_.quiet_until_ns = arrival;
    faults_.SetOrigin(state_.origin);
    for (ClientPart& own : clients_) own.faults.SetOrigin(state_.origin);
    if (state_.next_send_ns == BootTime::Never()) BeginSending(arrival);
    AddEvent(0, "start_accepted", "t = 0");
    NoteActivations();
    LookAtConditions();
  } else if (starts_count == 0) {
    ++starts_count;
  } else if (protocol_.repeated_start_is_boot) {
    ++starts_count;
    AddEvent(SimTime(arrival), kStartRepeatedEvent, "the client sent `start` again: it restarted", client);
  }
}

void LocalPlantServer::AnswerSensorRequest(std::size_t client, BootTime arrival,
                                           const link::MessageType& request, const Reply& reply) {
  SampleFor(client, arrival);
  reply(FrameFor(client, arrival, BindingOf(*protocol_.Find(request.reply))));
  if (state_.started() && &request == &period_message_)
    sink_.Write({SimTime(arrival), client, record::Accepted{record::AcceptedKind::kRequest}});
}

// Reads the client's sensors, with their faults.
void LocalPlantServer::SampleFor(std::size_t client, BootTime now) {
  const TimeNs sampled = state_.started() ? SimTime(boundary_ns_) : kPowerOn;
  plant_.ReadSensors(readings_, FrameOf(scenario_.angular_rates));
  sent_ = readings_;
  ClientPart& own = clients_[client];
  own.faults.EditSensors(sampled, sent_, now);
  NoteActivations();
  own.sensed = sent_;
}

std::vector<std::uint8_t> LocalPlantServer::FrameFor(std::size_t client, BootTime now,
                                                     const MessageBinding& message) {
  std::vector<double> values = message.Values(clients_[client].sensed);
  const auto true_values = [&] { return message.Values(readings_); };
  for (std::string& beyond : ranges_.Look(message.type(), values, true_values))
    AddEvent(state_.started() ? SimTime(now) : 0, kBeyondRangeSentEvent,
             fmt::format("the message '{}' carries {}", message.type().name, beyond), client);
  clients_[client].stamps.Write(message.type(), now, values);
  return protocol_.framing->Encode(protocol_.Encode(message.type(), values).span());
}

void LocalPlantServer::BeginSending(BootTime now) {
  for (OwnMessage& message : own_messages_) state_.next_send_ns = message.next_ns = now;
}

void LocalPlantServer::SendOwn(BootTime now, const SendTo& send) {
  if (now < state_.next_send_ns) return;
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    SampleFor(client, now);
    for (const OwnMessage& message : own_messages_)
      if (message.next_ns <= now) send(client, FrameFor(client, now, *message.binding));
  }
  state_.next_send_ns = BootTime::Never();
  for (OwnMessage& message : own_messages_) {
    const TimeNs period_ns = message.binding->type().period_ns;
    if (message.next_ns <= now) message.next_ns += ((now - message.next_ns) / period_ns + 1) * period_ns;
    state_.next_send_ns = std::min(state_.next_send_ns, message.next_ns);
  }
}

void LocalPlantServer::AcceptInput(std::size_t client, BootTime arrival, const link::Message& message) {
  // The first of several actuator messages counts the client's commands.
  if (message.type->kind != link::MessageKind::kActuators ||
      message.type == protocol_.Find(link::MessageKind::kActuators))
    sink_.Write({SimTime(arrival), client, record::Accepted{record::AcceptedKind::kActuators}});
  ClientPart& own = clients_[client];
  BindingOf(*message.type).Put(message.values, own.asked);
  BindingOf(*message.type).Put(message.values, own.command);
  arbiter_.Accept(client, SimTime(arrival), own.command);
}

void LocalPlantServer::Advance(BootTime to, const AllCounts& counts) {
  if (!state_.started()) return;
  while (to > boundary_ns_ && !state_.over) {
    if (!boundary_left_) LeaveBoundary(counts);
    state_.quiet_until_ns = boundary_ns_ + scenario_.step_ns - 1;
    if (boundary_ns_ + scenario_.step_ns > to) return;
    Check(boundary_left_, "an input is in force before the step");
    const Disturbance disturbance = faults_.DisturbanceOf(SimTime(boundary_ns_));
    if (!scenario_.held) plant_.Step(faulted_, disturbance);
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
      AddEvent(state_.reached_ns, std::string(Name(state_.end_reason)), state_.end_text);
    }
    NoteActivations();
    LookAtConditions();
  }
}

// Before anything else happens at this boundary.
void LocalPlantServer::LookAtConditions() {
  if (conditions_.empty() || SimTime(boundary_ns_) % protocol_.control_period_ns != 0) return;
  std::vector<double> row;
  Look(AllCounts(clients_.size()), row);
  std::vector<faults::FaultEvent> events;
  conditions_.Look(SimTime(boundary_ns_), row, events);
  Hear(events);
  news_.insert(news_.end(), events.begin(), events.end());
}

void LocalPlantServer::Look(const AllCounts& counts, std::vector<double>& row) const {
  row.assign(layout_.columns.size(), kNothingYet);
  FillRow(state_.started() ? SimTime(boundary_ns_) : 0, counts, row);
}

void LocalPlantServer::Hear(std::span<const faults::FaultEvent> events) {
  faults_.Hear(events);
  for (ClientPart& own : clients_) own.faults.Hear(events);
}

void LocalPlantServer::NoteActivations() {
  const auto note = [&](faults::FaultSchedule& from) {
    const std::vector<faults::FaultEvent> events = from.PollEvents();
    if (events.empty()) return;
    if (&from != &faults_) faults_.Hear(events);
    for (ClientPart& own : clients_)
      if (&own.faults != &from) own.faults.Hear(events);
    news_.insert(news_.end(), events.begin(), events.end());
  };
  note(faults_);
  for (ClientPart& own : clients_) note(own.faults);
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
  faulted_ = arbiter_.Decide(t).inputs;
  for (Arbiter::Event& event : arbiter_.TakeEvents())
    AddEvent(t, std::move(event.kind), std::move(event.text));
  faults_.EditInput(t, faulted_, arbiter_.has_new_command());
  in_force_ = faulted_;
  plant_.InputInForce(in_force_);
  NoteActivations();
}

void LocalPlantServer::LeaveBoundary(const AllCounts& counts) {
  boundary_left_ = true;
  PutInputInForce();
  if (SimTime(boundary_ns_) % protocol_.control_period_ns == 0) LogRow(boundary_ns_, counts);
}

void LocalPlantServer::LogRow(BootTime at, const AllCounts& counts) {
  const TimeNs t = SimTime(at);
  Check(logged_ns_ < t, "rows are logged in order of time, each once");
  logged_ns_ = t;
  row_.time_ns = t;
  std::vector<double>& values = std::get<record::Row>(row_.body).values;
  values.assign(layout_.columns.size(), kNothingYet);
  FillRow(t, counts, values);
  sink_.Write(row_);
}

// `row` holds NaN.
void LocalPlantServer::FillRow(TimeNs t, const AllCounts& counts, std::span<double> row) const {
  row[0] = ToSeconds(t);
  plant_.State(row.subspan(layout_.states, signals_.states.size()));
  std::copy(in_force_.begin(), in_force_.end(), row.begin() + Offset(layout_.inputs));
  const ReferencePoint reference = trajectory_.At(t);
  std::copy_n(reference.position_m.begin(), 3, row.begin() + Offset(layout_.reference));
  row[layout_.reference + 3] = reference.yaw_rad;
  plant_.Measure(row.subspan(layout_.measured, signals_.measured.size()));
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    const std::vector<double>&sensed = clients_[client].sensed, &asked = clients_[client].asked;
    std::copy(sensed.begin(), sensed.end(), row.begin() + Offset(layout_.sensed + client * sensed.size()));
    std::copy(asked.begin(), asked.end(), row.begin() + Offset(layout_.commanded + client * asked.size()));
  }
  if (layout_.on_ground) row[*layout_.on_ground] = plant_.OnGround() ? 1.0 : 0.0;
  if (layout_.arbiter_selected) row[*layout_.arbiter_selected] = arbiter_.choice().selected;
  for (std::size_t i = 0; i < counts.size(); ++i)
    PutCounters(counts[i], row.subspan(layout_.link_counters + i * kLineCounters));
  double& active_count = row[layout_.faults_active_count] = 0;
  for (std::size_t i = 0; i < layout_.watch - layout_.active; ++i) {
    const double active = row[layout_.active + i] = faults_.IsActive(i, t) ? 1.0 : 0.0;
    active_count += active;
  }
}

void LocalPlantServer::AddEvent(TimeNs time_ns, std::string kind, std::string text,
                                std::optional<std::size_t> client) {
  if (auto event = events_.Pass(std::move(kind), std::move(text)))
    sink_.Write({time_ns, client, *std::move(event)});
}

void LocalPlantServer::WriteActivations() {
  const auto write = [&](faults::FaultSchedule& faults, std::optional<std::size_t> client) {
    for (faults::Activation& activation : faults.TakeActivations(state_.origin)) {
      const TimeNs time_ns = activation.time_ns;
      sink_.Write({time_ns, client, std::move(activation)});
    }
  };
  write(faults_, {});
  for (std::size_t client = 0; client < clients_.size(); ++client) write(clients_[client].faults, client);
}

void LocalPlantServer::WriteTotals() {
  WriteActivations();
  record::PlantEnd end{
      hover_input_, input_min_, input_max_, {}, arbiter_.Totals(std::max(state_.reached_ns, logged_ns_))};
  sink_.Write({state_.reached_ns, {}, record::ActivationCounts{faults_.ActivationCounts()}});
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    sink_.Write(
        {state_.reached_ns, client, record::ActivationCounts{clients_[client].faults.ActivationCounts()}});
    end.starts_accepted_counts.push_back(clients_[client].starts_accepted_count);
  }
  sink_.Write({state_.reached_ns, {}, std::move(end)});
}

}  // namespace tiltproof::harness
