// The faults that act at the plant: on the samples of its sensors, on the input in force, and on the vehicle
// itself; each kind in the order of the file.
//
// Each sample, command and step has a number. What a fault draws for it follows only from this number.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "faults/fault_type.h"
#include "faults/recorder.h"
#include "faults/trigger.h"
#include "link/disturbance.h"
#include "link/signal_table.h"

namespace tiltproof::faults {

class VehicleFaults {
 public:
  // The inputs from which a fault of any kind here is made. All but `parameters` must outlive VehicleFaults.
  struct Entry {
    std::size_t fault;
    const Activity& activity;
    Trigger trigger;
    const Parameters& parameters;
    std::uint64_t stream;  // of the model's draws, one generator per sample or step
    bool open = false;     // it has no model yet
  };

  // `signals` and `recorder` must outlive it. `grows`: faults are added in flight, and have seen the past.
  VehicleFaults(const VehicleSignals& signals, TimeNs step_ns, Recorder& recorder, bool grows)
      : signals_(signals), step_ns_(step_ns), recorder_(recorder), grows_(grows) {}

  void Add(const SensorKind& kind, const Entry& entry);
  void Add(const ActuatorKind& kind, const Entry& entry);
  void Add(const PlantKind& kind, const Entry& entry);
  // The model of a fault that was added as an open one.
  void Give(const SensorKind& kind, const Entry& entry);
  void Give(const ActuatorKind& kind, const Entry& entry);
  void Give(const PlantKind& kind, const Entry& entry);

  // Like the functions of FaultSchedule with these names.
  void EditSensors(TimeNs t, std::span<double> values, BootTime boot_time);
  void EditInput(TimeNs t, std::span<double> input, bool new_command);
  Disturbance DisturbanceOf(TimeNs t);

 private:
  struct Injector {
    explicit Injector(const Entry& entry)
        : fault(entry.fault), activity(&entry.activity), trigger(entry.trigger), stream(entry.stream) {}
    std::size_t fault;
    const Activity* activity;
    Trigger trigger;
    std::uint64_t stream;
  };
  struct Sensor : Injector {
    bool always_counts;
    std::unique_ptr<SensorModel> model;
  };
  struct Actuator : Injector {
    std::unique_ptr<ActuatorModel> model;
    // For the latest command: whether the trigger was asked, its answer, and whether a change was counted.
    bool decided = false, picked = false, counted = false;
  };
  struct Body : Injector {
    std::unique_ptr<PlantModel> model;
    bool disturbed = false;  // in the previous step
  };

  // A sample or an input as it left the faults, for models that start from the past.
  struct Past {
    TimeNs time_ns, period_ns;
    std::uint64_t number;
    std::vector<double> values;
  };
  void Keep(std::deque<Past>& past, Past&& latest) const;
  void PassOpen(TimeNs time_ns, TimeNs period_ns, std::uint64_t number, std::span<const double> values) {
    passed_open_.push_back({time_ns, period_ns, number, {values.begin(), values.end()}});
  }

  // Rounds the values that have 32 bits when they are sent.
  void RoundToLine(std::span<double> values) const;
  StepContext ContextOf(TimeNs t, std::uint64_t number, const Injector& injector, Random& random) const {
    return {t, step_ns_, number, *injector.activity, random};
  }

  const VehicleSignals& signals_;
  TimeNs step_ns_;
  Recorder& recorder_;
  const bool grows_;
  std::deque<Past> samples_, inputs_;
  std::vector<Past> passed_open_;  // by the open fault
  std::vector<Sensor> sensors_;
  std::vector<Actuator> actuators_;
  std::vector<Body> bodies_;
  std::uint64_t sample_count_ = 0, command_count_ = 0, input_count_ = 0, step_count_ = 0;
  TimeNs last_sample_ns_ = kPowerOn;
  std::vector<double> values_before_;
  std::vector<double> input_before_;
};

}  // namespace tiltproof::faults
