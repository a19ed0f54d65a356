#include "faults/schedule.h"

#include <algorithm>
#include <array>
#include <deque>
#include <optional>
#include <stdexcept>
#include <utility>

#include "faults/bits.h"
#include "faults/recorder.h"
#include "faults/registry.h"
#include "faults/text.h"
#include "faults/trigger.h"
#include "faults/vehicle_faults.h"
#include "faults/wire_faults.h"
#include "link/check.h"

namespace tiltproof::faults {
namespace {

using link::Direction;

std::vector<Direction> DirectionsOf(Target target) {
  switch (target) {
    case Target::kToClient:
      return {Direction::kToClient};
    case Target::kToPlant:
      return {Direction::kToPlant};
    case Target::kBoth:
      return {Direction::kToPlant, Direction::kToClient};
    case Target::kReference:
      return {Direction::kReference};
    case Target::kNone:
      return {};
  }
  return {};
}

struct ReceiverInjector {
  std::size_t fault;
  link::Direction direction;
  const Activity* activity;
  Trigger trigger;
  ReceiveMark mark;
  double probability;
  std::uint64_t stream;  // one generator per byte
};

}  // namespace

struct FaultSchedule::State {
  State(std::size_t fault_count, std::uint64_t seed_in, const Place& place)
      : protocol(place.protocol),
        recorder(fault_count, place.use.keeps_activations),
        seed(seed_in),
        client(place.client),
        line(place.line),
        grows(place.use.grows),
        open(place.use.open) {
    for (WireFaults& wire : wires) {
      wire.SetRecorder(&recorder);
      if (grows) wire.Grow();
    }
    for (LineRate& rate : rates) {
      rate.baud = place.baud;
      rate.character = place.character;
    }
    rates[static_cast<std::size_t>(Direction::kReference)].baud = place.reference_baud;
    if (place.signals) {
      signals = *place.signals;
      vehicle.emplace(signals, place.step_ns, recorder, grows);
    }
  }

  // A fault of one kind, where it acts.
  struct Entry {
    std::size_t fault;
    const FaultSpec& spec;
    const FaultType& type;
    std::uint64_t seed;
    Parameters parameters = ResolvedParameters(spec, type);
    Trigger trigger = Trigger(spec, StreamKey(seed, {spec.id, "trigger"}));
  };
  void Add(const WireKind& kind, const Entry& entry) {
    Check(protocol != nullptr, "a line with faults has a protocol");
    if (const std::string problem = MessageProblem(entry.spec, entry.type, *protocol); !problem.empty())
      throw std::invalid_argument(Concat({"fault '", entry.spec.id, "', message: ", problem}));
    for (const Direction direction : DirectionsOf(ResolvedTarget(entry.spec, entry.type))) {
      const auto index = static_cast<std::size_t>(direction);
      wires[index].Add(entry.fault, entry.spec, kind, activities[entry.fault], entry.parameters, entry.seed,
                       direction, rates[index], *protocol, entry.fault == open);
    }
  }
  void Give(const WireKind& kind, const Entry& entry) {
    for (const Direction direction : DirectionsOf(ResolvedTarget(entry.spec, entry.type)))
      wires[static_cast<std::size_t>(direction)].Give(entry.fault, entry.spec, kind, entry.parameters,
                                                      entry.seed, direction, *protocol);
  }
  void Add(const ReceiverKind& kind, const Entry& entry) {
    for (const Direction direction : DirectionsOf(ResolvedTarget(entry.spec, entry.type))) {
      std::uint64_t stream = StreamKey(entry.seed, {entry.spec.id, "model"});
      if (!entry.spec.line.empty()) stream = StreamKey(entry.seed, {entry.spec.id, "model", Name(direction)});
      receivers.push_back({.fault = entry.fault,
                           .direction = direction,
                           .activity = &activities[entry.fault],
                           .trigger = entry.trigger,
                           .mark = kind.mark,
                           .probability = entry.parameters.Number("probability"),
                           .stream = stream});
    }
  }
  template <class Kind>
  void AddToVehicle(const Kind& kind, const Entry& entry) {
    if (vehicle) vehicle->Add(kind, VehicleEntry(entry));
  }
  template <class Kind>
  void GiveToVehicle(const Kind& kind, const Entry& entry) {
    if (vehicle) vehicle->Give(kind, VehicleEntry(entry));
  }
  VehicleFaults::Entry VehicleEntry(const Entry& entry) const {
    return {entry.fault,
            activities[entry.fault],
            entry.trigger,
            entry.parameters,
            StreamKey(entry.seed, {entry.spec.id, "model"}),
            entry.fault == open};
  }
  void Add(const SensorKind& kind, const Entry& entry) { AddToVehicle(kind, entry); }
  void Add(const ActuatorKind& kind, const Entry& entry) { AddToVehicle(kind, entry); }
  void Add(const PlantKind& kind, const Entry& entry) { AddToVehicle(kind, entry); }
  void Give(const SensorKind& kind, const Entry& entry) { GiveToVehicle(kind, entry); }
  void Give(const ActuatorKind& kind, const Entry& entry) { GiveToVehicle(kind, entry); }
  void Give(const PlantKind& kind, const Entry& entry) { GiveToVehicle(kind, entry); }
  template <class Kind>
  void Give(const Kind& /*kind*/, const Entry& /*entry*/) {
    Check(false, "a fault that is open edits what passes");
  }
  // Commands act elsewhere.
  void Add(const NodeKind& /*kind*/, const Entry& /*entry*/) {}
  void Add(const DeviceKind& /*kind*/, const Entry& /*entry*/) {}
  void Add(const ClockKind& /*kind*/, const Entry& /*entry*/) {}

  // The part of the flight with the vehicle.
  VehicleFaults& Vehicle() {
    Check(vehicle.has_value(), "faults on the vehicle act where the plant is");
    return *vehicle;
  }

  std::shared_ptr<const link::Protocol> protocol;
  Recorder recorder;
  std::array<WireFaults, link::kDirectionCount> wires;
  VehicleSignals signals;
  std::optional<VehicleFaults> vehicle;
  std::vector<ReceiverInjector> receivers;
  std::array<LineRate, link::kDirectionCount> rates;
  std::deque<Activity> activities;  // by fault; the injectors point there
  // By fault: those that follow it (`after`).
  std::vector<std::vector<std::size_t>> followers;
  Origin origin;
  std::array<std::uint64_t, link::kDirectionCount> received_count{};
  std::array<BootTime, link::kDirectionCount> received_ns{BootTime::Earliest(), BootTime::Earliest(),
                                                          BootTime::Earliest()};  // the last byte
  // True if the fault may act here.
  bool ActsHere(const FaultSpec& spec) const {
    return spec.line == line && (client.empty() || spec.client.empty() || spec.client == client);
  }

  const std::uint64_t seed;
  const std::string client;  // empty: the only one
  const std::string line;    // between boards; empty: the clients' own
  const bool grows;
  std::optional<std::size_t> open;
  std::deque<FaultSpec> added;
};

FaultSchedule::FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed, const Place& place)
    : state_(std::make_unique<State>(specs.size(), seed, place)) {
  std::vector<const FaultType*> types;
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    types.push_back(&ValidType(specs[fault]));
    state_->activities.emplace_back(specs[fault], WindowOf(specs[fault]));
  }
  state_->followers.resize(specs.size());
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    const auto& after = specs[fault].after;
    if (!after) continue;
    const auto followed = std::find_if(specs.begin(), specs.end(),
                                       [&](const FaultSpec& other) { return other.id == after->fault; });
    if (followed == specs.end())
      throw std::invalid_argument(
          Concat({"fault '", specs[fault].id, "', after.fault: there is no fault '", after->fault, "'"}));
    state_->followers[static_cast<std::size_t>(followed - specs.begin())].push_back(fault);
  }
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    if (!state_->ActsHere(specs[fault])) continue;
    std::visit(
        [&](const auto& kind) {
          state_->Add(kind, {fault, specs[fault], *types[fault], seed});
        },
        types[fault]->kind);
  }
}

void FaultSchedule::Add(const FaultSpec& spec) {
  Check(state_->grows, "faults are added to a schedule that grows");
  const FaultType& type = ValidType(spec);
  const FaultSpec& kept = state_->added.emplace_back(spec);
  const std::size_t fault = state_->activities.size();
  state_->activities.emplace_back(kept, WindowOf(kept));
  state_->followers.emplace_back();
  state_->recorder.Grow();
  if (!state_->ActsHere(kept)) return;
  std::visit([&](const auto& kind) { state_->Add(kind, {fault, kept, type, state_->seed}); }, type.kind);
}

void FaultSchedule::Give(const FaultSpec& spec) {
  Check(state_->open.has_value(), "a fault is given to a schedule in which one is open");
  const std::size_t fault = *std::exchange(state_->open, std::nullopt);
  const FaultType& type = ValidType(spec);
  const FaultSpec& kept = state_->added.emplace_back(spec);
  Check(state_->recorder.counts()[fault] == 0, "an open fault has not acted");
  state_->activities[fault] = Activity(kept, WindowOf(kept));
  if (!state_->ActsHere(kept)) return;
  std::visit([&](const auto& kind) { state_->Give(kind, {fault, kept, type, state_->seed}); }, type.kind);
}

std::vector<FaultEvent> FaultSchedule::PollEvents() {
  std::vector<FaultEvent> events;
  if (!state_->origin.known()) return events;
  for (const Recorder::First& first : state_->recorder.TakeFirsts()) {
    CheckIndex(first.fault, state_->followers.size(), "a first activation is of a fault of the schedule");
    if (state_->followers[first.fault].empty()) continue;
    const auto* boot_time = std::get_if<BootTime>(&first.time_ns);
    const TimeNs time_ns =
        boot_time != nullptr ? state_->origin.SimulationTime(*boot_time) : std::get<TimeNs>(first.time_ns);
    events.push_back({FaultEvent::Kind::kFirstActivation, first.fault, time_ns});
  }
  Hear(events);
  return events;
}

void FaultSchedule::Hear(std::span<const FaultEvent> events) {
  for (const FaultEvent& item : events) {
    CheckIndex(item.fault, state_->activities.size(), "events are of a fault of the schedule");
    Activity& activity = state_->activities[item.fault];
    switch (item.kind) {
      case FaultEvent::Kind::kFirstActivation:
        for (const std::size_t follower : state_->followers[item.fault])
          state_->activities[follower].OnFollowed(item.time_ns);
        break;
      case FaultEvent::Kind::kConditionHolds:
      case FaultEvent::Kind::kConditionEnds:
        activity.OnCondition(item.time_ns, item.kind == FaultEvent::Kind::kConditionHolds);
        break;
      case FaultEvent::Kind::kCut:
        activity.OnCut(item.time_ns);
        break;
    }
  }
}

FaultSchedule::~FaultSchedule() = default;
FaultSchedule::FaultSchedule(FaultSchedule&&) noexcept = default;
FaultSchedule& FaultSchedule::operator=(FaultSchedule&&) noexcept = default;

link::ChunkFilter* FaultSchedule::Filter(link::Direction direction) {
  WireFaults& wire = state_->wires[static_cast<std::size_t>(direction)];
  return wire.empty() && !state_->grows ? nullptr : &wire;
}

bool FaultSchedule::MayAlter(Direction direction) const {
  const auto opposite = link::Opposite(direction);
  return state_->grows || !state_->wires[static_cast<std::size_t>(direction)].empty() ||
         (opposite && state_->wires[static_cast<std::size_t>(*opposite)].sends_back());
}

std::vector<link::Chunk> FaultSchedule::TakeSentBack(Direction direction) {
  return state_->wires[static_cast<std::size_t>(direction)].TakeSentBack();
}

FaultSchedule::Crowd FaultSchedule::CrowdOf(Direction direction) const {
  const WireFaults& wire = state_->wires[static_cast<std::size_t>(direction)];
  Crowd crowd{wire.Multipliers(), wire.Holders()};
  if (const auto opposite = link::Opposite(direction))
    for (const std::size_t fault : state_->wires[static_cast<std::size_t>(*opposite)].Returners())
      crowd.multipliers.push_back(fault);
  return crowd;
}

void FaultSchedule::SetOrigin(Origin origin) {
  for (WireFaults& wire : state_->wires) wire.SetOrigin(origin);
  state_->origin = origin;
}

void FaultSchedule::EditSensors(TimeNs t, std::span<double> values, BootTime boot_time) {
  VehicleFaults& vehicle = state_->Vehicle();
  Check(values.size() == state_->signals.sensors.size(), "a sample has a value for each sensor");
  vehicle.EditSensors(t, values, boot_time);
}

void FaultSchedule::EditInput(TimeNs t, std::span<double> input, bool new_command) {
  VehicleFaults& vehicle = state_->Vehicle();
  Check(input.size() == state_->signals.inputs.size(), "an input has a value for each actuator");
  vehicle.EditInput(t, input, new_command);
}

Disturbance FaultSchedule::DisturbanceOf(TimeNs t) { return state_->Vehicle().DisturbanceOf(t); }

void FaultSchedule::MarkReceived(Direction direction, BootTime last_arrival,
                                 std::span<const std::uint8_t> bytes, std::vector<ReceiveMark>& marks,
                                 std::span<const std::uint8_t> parity_errors) {
  BootTime& received = state_->received_ns[static_cast<std::size_t>(direction)];
  Check(received <= last_arrival, "bytes reach the receiver in order of time");
  received = last_arrival;
  marks.assign(bytes.size(), ReceiveMark::kNone);
  const LineRate& rate = state_->rates[static_cast<std::size_t>(direction)];
  std::uint64_t& number = state_->received_count[static_cast<std::size_t>(direction)];
  if (state_->receivers.empty()) number += bytes.size();  // one may be added
  for (std::size_t i = 0; i < bytes.size() && !state_->receivers.empty(); ++i, ++number) {
    const BootTime arrival = last_arrival - rate.BytesTime(static_cast<std::int64_t>(bytes.size() - 1 - i));
    for (ReceiverInjector& injector : state_->receivers) {
      if (injector.direction != direction ||
          !injector.activity->Contains(state_->origin.SimulationTime(arrival)) ||
          !injector.trigger.Picks(number) ||
          !Random(KeyOf(injector.stream, number)).Bernoulli(injector.probability) ||
          marks[i] != ReceiveMark::kNone)
        continue;
      marks[i] = injector.mark;
      state_->recorder.Count(injector.fault, [&]() -> BootActivation {
        const link::Chunk byte{.begin_ns = arrival, .bytes = {bytes[i]}};
        const bool is_lost = injector.mark == ReceiveMark::kOverrun;
        return {.time_ns = arrival,
                .fault = injector.fault,
                .what = Concat({Name(injector.mark), ": ", Hex(bytes[i]), is_lost ? " lost" : " flagged"}),
                .before = {byte},
                .after = is_lost ? std::vector<link::Chunk>{} : std::vector{byte}};
      });
    }
  }
  for (std::size_t i = 0; i < parity_errors.size(); ++i)
    if (parity_errors[i] != 0 && marks[i] == ReceiveMark::kNone) marks[i] = ReceiveMark::kParity;
}

void FaultSchedule::Count(std::size_t fault, TimeNs t, std::string what) {
  state_->recorder.Count(fault, [&]() -> Activation {
    return {.time_ns = t, .fault = fault, .what = std::move(what), .before = {}, .after = {}};
  });
}

bool FaultSchedule::IsActive(std::size_t fault, TimeNs t) const {
  return state_->activities[fault].Contains(t);
}

const std::vector<std::int64_t>& FaultSchedule::ActivationCounts() const { return state_->recorder.counts(); }

std::vector<Activation> FaultSchedule::TakeActivations(Origin origin) {
  return state_->recorder.Take(origin);
}

}  // namespace tiltproof::faults
