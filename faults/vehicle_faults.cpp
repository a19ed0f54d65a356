#include "faults/vehicle_faults.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

// "x_m 1.25 -> 1.75, ...": the values that differ.
template <class Scalar>
std::string Changes(std::span<const Scalar> before, std::span<const Scalar> after, const SignalTable& table) {
  std::string text;
  for (std::size_t i = 0; i < table.size(); ++i) {
    if (before[i] == after[i]) continue;
    std::array<char, 96> change{};
    std::snprintf(change.data(), change.size(), "%s%s %.9g -> %.9g", text.empty() ? "" : ", ",
                  table[i].name.c_str(), static_cast<double>(before[i]), static_cast<double>(after[i]));
    text += change.data();
  }
  return text.empty() ? "nothing changed" : text;
}

// "force 3 0 0 N, ...": what it says.
std::string Text(const Disturbance& disturbance) {
  const Disturbance none;
  std::string text;
  const auto say = [&](const char* format, auto... values) {
    std::array<char, 128> part{};
    std::snprintf(part.data(), part.size(), format, values...);
    text += (text.empty() ? "" : ", ") + std::string(part.data());
  };
  const auto vector = [&](const char* format, const Disturbance::Vector& v) {
    if (v != Disturbance::Vector{}) say(format, v[0], v[1], v[2]);
  };
  vector("force %.6g %.6g %.6g N", disturbance.force_n);
  vector("torque %.6g %.6g %.6g N m", disturbance.torque_nm);
  vector("torque %.6g %.6g %.6g N m about the body's axes", disturbance.torque_body_nm);
  vector("wind %.6g %.6g %.6g m/s", disturbance.wind_m_s);
  vector("centre of mass shifted by %.6g %.6g %.6g m", disturbance.com_shift_m);
  if (disturbance.mass_factor != none.mass_factor) say("mass times %.6g", disturbance.mass_factor);
  if (disturbance.inertia_factor != none.inertia_factor)
    say("inertia times %.6g", disturbance.inertia_factor);
  for (std::size_t i = 0; i < kRotorsMax; ++i) {
    if (disturbance.thrust_factor[i] != 1.0)
      say("thrust of rotor %zu times %.6g", i, disturbance.thrust_factor[i]);
    if (disturbance.hinges[i].held) say("hinge %zu at %.6g rad/s", i, disturbance.hinges[i].rate_rad_s);
  }
  return text;
}

template <class Scalar>
bool Same(std::span<const Scalar> a, std::span<const Scalar> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

// The same fault on each of these sensors by itself.
class EachSensor : public SensorModel {
 public:
  EachSensor(const SensorKind& kind, const SignalSetup& setup, const std::vector<std::string>& names) {
    for (const std::string& name : names) {
      const std::uint64_t stream = StreamKey(setup.stream, {name});
      const Parameters parameters = setup.parameters.With("signal", name);
      models_.push_back({stream, kind.make({parameters, setup.signals, stream})});
    }
  }

  void Act(std::span<double> values, const SampleContext& context) override {
    for (const auto& [stream, model] : models_) {
      Random random(KeyOf(stream, context.number));
      model->Act(values, {context.time_ns, context.number, context.period_ns, context.activity, random});
    }
  }
  void Pass(std::span<const double> values, const SampleContext& context) override {
    for (const auto& [stream, model] : models_) {
      Random random(KeyOf(stream, context.number));
      model->Pass(values, {context.time_ns, context.number, context.period_ns, context.activity, random});
    }
  }

 private:
  std::vector<std::pair<std::uint64_t, std::unique_ptr<SensorModel>>> models_;
};

std::unique_ptr<SensorModel> MakeSensorModel(const SensorKind& kind, const SignalSetup& setup) {
  std::vector<std::string> names;
  if (!kind.on_vector && setup.parameters.Has("signal"))
    names = SensorsNamedBy(setup.signals, setup.parameters.Text("signal"));
  if (names.empty()) return kind.make(setup);
  return std::make_unique<EachSensor>(kind, setup, names);
}

}  // namespace

void VehicleFaults::Add(const SensorKind& kind, const Entry& entry) {
  const SignalSetup setup{entry.parameters, signals_, entry.stream};
  const Sensor& sensor = sensors_.emplace_back(
      Sensor{Injector(entry), kind.always_counts, entry.open ? nullptr : MakeSensorModel(kind, setup)});
  if (entry.open) return;
  for (const Past& past : samples_) {
    Random random(KeyOf(sensor.stream, past.number));
    sensor.model->Pass(past.values, {past.time_ns, past.number, past.period_ns, *sensor.activity, random});
  }
}

void VehicleFaults::Add(const ActuatorKind& kind, const Entry& entry) {
  const Actuator& actuator = actuators_.emplace_back(Actuator{
      Injector(entry), entry.open ? nullptr : kind.make({entry.parameters, signals_, entry.stream})});
  if (entry.open) return;
  for (const Past& past : inputs_) {
    Random random(KeyOf(actuator.stream, past.number));
    actuator.model->Pass(past.values, ContextOf(past.time_ns, past.number, actuator, random));
  }
}

void VehicleFaults::Add(const PlantKind& kind, const Entry& entry) {
  bodies_.push_back(
      {Injector(entry), entry.open ? nullptr : kind.make({entry.parameters, signals_, entry.stream})});
}

void VehicleFaults::Give(const SensorKind& kind, const Entry& entry) {
  for (Sensor& sensor : sensors_) {
    if (sensor.fault != entry.fault) continue;
    sensor.model = MakeSensorModel(kind, {entry.parameters, signals_, entry.stream});
    for (const Past& past : std::exchange(passed_open_, {})) {
      Random random(KeyOf(sensor.stream, past.number));
      sensor.model->Pass(past.values, {past.time_ns, past.number, past.period_ns, *sensor.activity, random});
    }
  }
}

void VehicleFaults::Give(const ActuatorKind& kind, const Entry& entry) {
  for (Actuator& actuator : actuators_) {
    if (actuator.fault != entry.fault) continue;
    actuator.model = kind.make({entry.parameters, signals_, entry.stream});
    for (const Past& past : std::exchange(passed_open_, {})) {
      Random random(KeyOf(actuator.stream, past.number));
      actuator.model->Pass(past.values, ContextOf(past.time_ns, past.number, actuator, random));
    }
  }
}

void VehicleFaults::Give(const PlantKind& kind, const Entry& entry) {
  for (Body& body : bodies_) {
    if (body.fault != entry.fault) continue;
    body.model = kind.make({entry.parameters, signals_, entry.stream});
    for (const Past& past : std::exchange(passed_open_, {})) {
      Random random(KeyOf(body.stream, past.number));
      body.model->Pass(ContextOf(past.time_ns, past.number, body, random));
    }
  }
}

// No model of a sensor or actuator looks back further than 10 s (`delay_ms`).
void VehicleFaults::Keep(std::deque<Past>& past, Past&& latest) const {
  if (!grows_) return;
  constexpr TimeNs kReachNs = 11 * kNsPerS;
  constexpr std::size_t kPastMax = 16'384;
  while (!past.empty() && (past.front().time_ns < latest.time_ns - kReachNs || past.size() >= kPastMax))
    past.pop_front();
  past.push_back(std::move(latest));
}

void VehicleFaults::RoundToLine(std::span<double> values) const {
  for (double& value : values.first(values.size() - signals_.measured.size()))
    value = static_cast<double>(static_cast<float>(value));
}

void VehicleFaults::EditSensors(TimeNs t, std::span<double> values, BootTime boot_time) {
  const bool before_origin = t == kPowerOn;
  const std::uint64_t number = sample_count_++;
  const TimeNs period_ns = before_origin || last_sample_ns_ == kPowerOn ? 0 : t - last_sample_ns_;
  last_sample_ns_ = t;
  RoundToLine(values);
  for (Sensor& sensor : sensors_) {
    Random random(KeyOf(sensor.stream, number));
    const SampleContext context{t, number, period_ns, *sensor.activity, random};
    if (!sensor.activity->Contains(t) || !sensor.trigger.Picks(number)) {
      if (sensor.model == nullptr)
        PassOpen(t, period_ns, number, values);
      else
        sensor.model->Pass(values, context);
      continue;
    }
    if (sensor.model == nullptr) throw OpenFaultActs();
    values_before_.assign(values.begin(), values.end());
    const std::span<const double> before = values_before_, after = values;
    sensor.model->Act(values, context);
    RoundToLine(values);
    if (Same(before, after) && !sensor.always_counts) continue;
    const auto record = [&](auto time) {
      return TimedActivation<decltype(time)>{.time_ns = time,
                                             .fault = sensor.fault,
                                             .what = Changes(before, after, signals_.sensors),
                                             .before = {},
                                             .after = {}};
    };
    if (before_origin) {
      recorder_.Count(sensor.fault, [&] { return record(boot_time); });
    } else {
      recorder_.Count(sensor.fault, [&] { return record(t); });
    }
  }
  Keep(samples_, {t, period_ns, number, {values.begin(), values.end()}});
}

void VehicleFaults::EditInput(TimeNs t, std::span<double> input, bool new_command) {
  if (new_command) ++command_count_;
  const std::uint64_t number = input_count_++;
  for (Actuator& actuator : actuators_) {
    if (new_command) actuator.decided = actuator.counted = false;
    const bool inside = actuator.activity->Contains(t);
    if (inside && !actuator.decided) {
      actuator.decided = true;
      actuator.picked = actuator.trigger.Picks(command_count_);
    }
    Random random(KeyOf(actuator.stream, number));
    const StepContext context = ContextOf(t, number, actuator, random);
    if (!inside || !actuator.picked) {
      if (actuator.model == nullptr)
        PassOpen(t, step_ns_, number, input);
      else
        actuator.model->Pass(input, context);
      continue;
    }
    if (actuator.model == nullptr) throw OpenFaultActs();
    input_before_.assign(input.begin(), input.end());
    const std::span<const double> before = input_before_, after = input;
    actuator.model->Act(input, context);
    if (actuator.counted || Same(before, after)) continue;
    actuator.counted = true;
    recorder_.Count(actuator.fault, [&]() -> Activation {
      return {.time_ns = t,
              .fault = actuator.fault,
              .what = Changes(before, after, signals_.inputs),
              .before = {},
              .after = {}};
    });
  }
  Keep(inputs_, {t, step_ns_, number, {input.begin(), input.end()}});
}

Disturbance VehicleFaults::DisturbanceOf(TimeNs t) {
  Disturbance all;
  const std::uint64_t number = step_count_++;
  for (Body& body : bodies_) {
    Disturbance own;
    Random random(KeyOf(body.stream, number));
    const StepContext context = ContextOf(t, number, body, random);
    const bool acts = body.activity->Contains(t) && body.trigger.Picks(number);
    if (body.model == nullptr) {
      if (acts) throw OpenFaultActs();
      PassOpen(t, step_ns_, number, {});
    } else if (acts) {
      own = body.model->Act(context);
    } else {
      body.model->Pass(context);
    }
    const bool begins = own != Disturbance{} && !body.disturbed;
    body.disturbed = own != Disturbance{};
    if (!body.disturbed) continue;
    all = Combined(all, own);
    if (!begins) continue;
    recorder_.Count(body.fault, [&]() -> Activation {
      return {.time_ns = t, .fault = body.fault, .what = Text(own), .before = {}, .after = {}};
    });
  }
  return all;
}

}  // namespace tiltproof::faults
