// The faults of a scenario, ready to act: made from data and a seed alone.
//
//   FaultSchedule faults(scenario.faults, scenario.seed, {.baud = 921600});
//   Wire wire(config, Direction::kToClient, protocol, faults.Filter(Direction::kToClient));
//   faults.SetOrigin(Origin(boot_time_of_t0));
//   faults.EditSensors(t, values);               // each sample that is sent
//   faults.EditInput(t, input, new_command);     // each step of the plant
//   plant.Step(input, faults.DisturbanceOf(t));
//   faults.MarkReceived(Direction::kToClient, arrival, bytes, marks);  // what reaches the firmware's receiver
//
// Faults on nodes and on the device have windows and counts here, and act elsewhere (faults/node_command.h,
// faults/device_command.h).
//
// Filters and the receiver work in boot time, everything else in simulation time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "faults/fault.h"
#include "faults/model.h"
#include "faults/news.h"
#include "link/chunk.h"
#include "link/disturbance.h"
#include "link/signal_table.h"

namespace tiltproof::faults {

class FaultSchedule {
 public:
  // What the part of the flight has in which these faults act.
  struct Place {
    std::int64_t baud = 921'600;            // of the main line; 0 = ideal
    std::int64_t reference_baud = 921'600;  // of the reference line
    // The vehicle's, where the plant is; without them the faults on it are only counted here.
    std::optional<VehicleSignals> signals = {};
    TimeNs step_ns = 4 * kNsPerMs;  // of the plant
    // Whose they are; faults of another client do not act here. Empty: of the flight's only one.
    std::string_view client = {};
  };

  // Throws std::invalid_argument, naming fault and key, when Validate() finds anything.
  FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed, const Place& place);
  FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed)
      : FaultSchedule(specs, seed, Place{}) {}
  ~FaultSchedule();
  FaultSchedule(FaultSchedule&&) noexcept;
  FaultSchedule& operator=(FaultSchedule&&) noexcept;

  // What stands in one direction; null when no fault does. Lives as long as the schedule, moved or not.
  link::ChunkFilter* Filter(link::Direction direction);

  // When more is to wait in a direction than link::kLineBytesMax: the faults that have put more bytes there than were
  // sent, and those that have kept some for later.
  struct Crowd {
    std::vector<std::size_t> multipliers, holders;
  };
  Crowd CrowdOf(link::Direction direction) const;

  // Until it is known, frames and received bytes are inside windows without a start
  // only.
  void SetOrigin(Origin origin);

  // The next three ask for a place with signals; rows are in the order of its tables.
  //
  // A sample that is about to be sent. `t` may be kPowerOn, for before t = 0: the record then has the time of
  // `boot_time`, which matters for nothing else.
  void EditSensors(TimeNs t, std::span<float> values, BootTime boot_time = {});

  // The input of the step that begins at `t`, once for each step. `new_command` false: the command is that of the
  // step before; it is neither counted nor drawn for again.
  void EditInput(TimeNs t, std::span<double> input, bool new_command = true);

  // What disturbs the vehicle during the step that begins at `t`, once for each step.
  Disturbance DisturbanceOf(TimeNs t);

  // Bytes that arrive back to back at the firmware's receiver, the last of them at `last_arrival`:
  // the receiver's mark of each, `marks` of the same size. To be called with every byte of the main line to the
  // client and of the reference line, in order; how they are spread over calls does not matter. A byte has one
  // mark: of several faults that pick it, that of the first in the file.
  void MarkReceived(link::Direction direction, BootTime last_arrival, std::span<const std::uint8_t> bytes,
                    std::vector<ReceiveMark>& marks);

  // A command of faults/node_command.h or faults/device_command.h was carried out at `t`, in simulation time; `what` says how.
  void Count(std::size_t fault, TimeNs t, std::string what);

  // What the other parts' schedules must hear of what happened in this one since the last call; this one has heard it. None
  // before t = 0 is known.
  std::vector<News> TakeNews();
  // What was said elsewhere, and conditions.
  void Hear(std::span<const News> news);

  // Whether the fault (its index in the scenario) is active at `t`.
  bool IsActive(std::size_t fault, TimeNs t) const;

  // How often each fault changed something (harness.null: was picked).
  const std::vector<std::int64_t>& ActivationCounts() const;
  // Those kept (faults/recorder.h) of each fault, the first kActivationsMax at most, in order of time, in simulation time;
  // without t = 0, those of a line in time since power-on. Leaves none.
  std::vector<Activation> TakeActivations(Origin origin = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tiltproof::faults
