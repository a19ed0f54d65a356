#include "faults/schedule.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "faults/bits.h"
#include "faults/recorder.h"
#include "faults/registry.h"
#include "faults/text.h"
#include "faults/trigger.h"
#include "faults/wire_stage.h"

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

// "x_m 1.25 -> 1.75, ...": the fields that differ.
template <class Group, class Fields, class Member>
std::string Changes(const Group& before, const Group& after, const Fields& fields, Member member) {
  std::string text;
  for (const auto& field : fields) {
    const auto from = before.*(field.*member);
    const auto to = after.*(field.*member);
    if (from == to) continue;
    std::array<char, 96> change{};
    std::snprintf(change.data(), change.size(), "%s%.*s %.9g -> %.9g", text.empty() ? "" : ", ",
                  static_cast<int>(field.column.size()), field.column.data(), static_cast<double>(from),
                  static_cast<double>(to));
    text += change.data();
  }
  return text.empty() ? "nothing changed" : text;
}

struct SensorInjector {
  std::size_t fault;
  Window window;
  Trigger trigger;
  bool always_counts;
  std::unique_ptr<SensorModel> model;
};

struct ReceiverInjector {
  std::size_t fault;
  link::Direction direction;
  Window scenario_window;  // in simulation time
  Window window;           // in boot time
  Trigger trigger;
  ReceiveMark mark;
  double probability;
  std::uint64_t stream;  // one generator a byte
};

struct ActuatorInjector {
  std::size_t fault;
  Window window;
  Trigger trigger;
  std::unique_ptr<ActuatorModel> model;
  // About the latest command: whether the trigger was asked and what it said, and whether a change was
  // counted.
  bool decided = false;
  bool picked = false;
  bool counted = false;
};

}  // namespace

struct FaultSchedule::State {
  explicit State(std::size_t fault_count) : recorder(fault_count) {
    for (WireStage& stage : stages) stage.SetRecorder(&recorder);
  }

  Recorder recorder;
  std::array<WireStage, link::kDirectionCount> stages;
  std::vector<SensorInjector> sensors;
  std::vector<ActuatorInjector> actuators;
  std::vector<ReceiverInjector> receivers;
  std::array<Line, link::kDirectionCount> lines;
  std::vector<Window> windows;  // by fault
  std::uint64_t sample_count = 0;
  std::uint64_t command_count = 0;
  std::array<std::uint64_t, link::kDirectionCount> received_count{};
};

FaultSchedule::FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed, const Lines& lines)
    : state_(std::make_unique<State>(specs.size())) {
  for (Line& line : state_->lines) line.baud = lines.baud;
  state_->lines[static_cast<std::size_t>(Direction::kReference)].baud = lines.reference_baud;
  std::vector<std::size_t> order;
  std::vector<const FaultType*> types;
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    types.push_back(&ValidType(specs[fault]));
    order.push_back(fault);
    state_->windows.push_back(WindowOf(specs[fault]));
  }
  std::stable_sort(order.begin(), order.end(),
                   [&types](std::size_t a, std::size_t b) { return types[a]->stage < types[b]->stage; });

  for (const std::size_t fault : order) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = *types[fault];
    if (type.is_command()) continue;  // not an edit
    const Parameters parameters = ResolvedParameters(spec, type);
    const Window& window = state_->windows[fault];
    const Trigger trigger(spec, StreamKey(seed, {spec.id, "trigger"}));
    if (type.on_receiver()) {
      state_->receivers.push_back({.fault = fault,
                                   .direction = DirectionsOf(ResolvedTarget(spec, type)).front(),
                                   .scenario_window = window,
                                   .window = spec.start_ns == kPowerOn ? Window{} : Window{kNever, kNever},
                                   .trigger = trigger,
                                   .mark = type.mark,
                                   .probability = parameters.Number("probability"),
                                   .stream = StreamKey(seed, {spec.id, "model"})});
    } else if (type.make_sensor != nullptr) {
      state_->sensors.push_back({fault, window, trigger, type.always_counts, type.make_sensor(parameters)});
    } else if (type.make_actuator != nullptr) {
      state_->actuators.push_back({fault, window, trigger, type.make_actuator(parameters)});
    } else {
      for (const Direction direction : DirectionsOf(ResolvedTarget(spec, type))) {
        const auto index = static_cast<std::size_t>(direction);
        state_->stages[index].Add(fault, spec, type, parameters, seed, direction, state_->lines[index]);
      }
    }
  }
}

FaultSchedule::~FaultSchedule() = default;
FaultSchedule::FaultSchedule(FaultSchedule&&) noexcept = default;
FaultSchedule& FaultSchedule::operator=(FaultSchedule&&) noexcept = default;

link::ChunkStage* FaultSchedule::Stage(link::Direction direction) {
  WireStage& stage = state_->stages[static_cast<std::size_t>(direction)];
  return stage.empty() ? nullptr : &stage;
}

FaultSchedule::Crowd FaultSchedule::CrowdOf(Direction direction) const {
  const WireStage& stage = state_->stages[static_cast<std::size_t>(direction)];
  return {stage.Multipliers(), stage.Holders()};
}

void FaultSchedule::SetOrigin(TimeNs boot_time_of_t0) {
  for (WireStage& stage : state_->stages) stage.SetOrigin(boot_time_of_t0);
  for (ReceiverInjector& injector : state_->receivers)
    injector.window = injector.scenario_window.At(boot_time_of_t0);
}

void FaultSchedule::EditSensors(TimeNs t, Sensors& sensors, TimeNs boot_time) {
  const bool before_origin = t == kPowerOn;
  const std::uint64_t number = state_->sample_count++;
  for (SensorInjector& injector : state_->sensors) {
    if (!injector.window.Contains(t) || !injector.trigger.Picks(number)) continue;
    const Sensors before = sensors;
    injector.model->Act(sensors);
    if (sensors == before && !injector.always_counts) continue;
    state_->recorder.Count(injector.fault, before_origin, [&]() -> Activation {
      return {.time_ns = before_origin ? boot_time : t,
              .fault = injector.fault,
              .what = Changes(before, sensors, kSensorFields, &SignalField<BasicSensors>::in_float),
              .before = {},
              .after = {}};
    });
  }
}

void FaultSchedule::EditActuators(TimeNs t, ActuatorsTruth& actuators, bool new_command) {
  if (new_command) ++state_->command_count;
  for (ActuatorInjector& injector : state_->actuators) {
    if (new_command) injector.decided = injector.counted = false;
    if (!injector.window.Contains(t)) continue;
    if (!injector.decided) {
      injector.decided = true;
      injector.picked = injector.trigger.Picks(state_->command_count);
    }
    if (!injector.picked) continue;
    const ActuatorsTruth before = actuators;
    injector.model->Act(actuators);
    if (actuators == before || injector.counted) continue;
    injector.counted = true;
    state_->recorder.Count(injector.fault, false, [&]() -> Activation {
      return {.time_ns = t,
              .fault = injector.fault,
              .what = Changes(before, actuators, kActuatorFields, &SignalField<BasicActuators>::in_double),
              .before = {},
              .after = {}};
    });
  }
}

void FaultSchedule::MarkReceived(Direction direction, TimeNs last_arrival,
                                 std::span<const std::uint8_t> bytes, std::vector<ReceiveMark>& marks) {
  marks.assign(bytes.size(), ReceiveMark::kNone);
  if (state_->receivers.empty()) return;
  const Line& line = state_->lines[static_cast<std::size_t>(direction)];
  std::uint64_t& number = state_->received_count[static_cast<std::size_t>(direction)];
  for (std::size_t i = 0; i < bytes.size(); ++i, ++number) {
    const TimeNs arrival = last_arrival - line.BytesTime(static_cast<std::int64_t>(bytes.size() - 1 - i));
    for (ReceiverInjector& injector : state_->receivers) {
      if (injector.direction != direction || !injector.window.Contains(arrival) ||
          !injector.trigger.Picks(number) ||
          !Random(KeyOf(injector.stream, number)).Bernoulli(injector.probability) ||
          marks[i] != ReceiveMark::kNone)
        continue;
      marks[i] = injector.mark;
      state_->recorder.Count(injector.fault, true, [&]() -> Activation {
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
}

TimeNs FaultSchedule::NextEdge(TimeNs t) const {
  TimeNs next = kNever;
  for (const ActuatorInjector& injector : state_->actuators) {
    for (const TimeNs edge : {injector.window.begin_ns, injector.window.end_ns}) {
      if (edge > t) next = std::min(next, edge);
    }
  }
  return next;
}

void FaultSchedule::Count(std::size_t fault, TimeNs t, std::string what) {
  state_->recorder.Count(fault, false, [&]() -> Activation {
    return {.time_ns = t, .fault = fault, .what = std::move(what), .before = {}, .after = {}};
  });
}

bool FaultSchedule::IsActive(std::size_t fault, TimeNs t) const { return state_->windows[fault].Contains(t); }

const std::vector<std::int64_t>& FaultSchedule::ActivationCounts() const { return state_->recorder.counts(); }

std::vector<Activation> FaultSchedule::TakeActivations(TimeNs origin_ns) {
  return state_->recorder.Take(origin_ns);
}

}  // namespace tiltproof::faults
