// The faults of a scenario, ready to act: made from data and a seed alone.
//
//   FaultSchedule faults(scenario.faults, scenario.seed, {.baud = 921600});
//   Wire wire(config, Direction::kToClient, dialect, faults.Stage(Direction::kToClient));
//   faults.SetOrigin(boot_time_of_t0);
//   faults.EditSensors(t, sensors);        // each sample that is sent
//   faults.EditActuators(t, input);        // each new command, and at NextEdge()
//   faults.MarkReceived(Direction::kToClient, arrival, bytes, marks);  // what reaches the firmware's receiver
//
// Faults on nodes and on the device have windows and counts here, and act elsewhere (faults/node_command.h,
// faults/device_command.h).
//
// Stages and the receiver work in the wires' time (boot time), everything else in simulation time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "faults/fault.h"
#include "faults/model.h"
#include "link/chunk.h"
#include "link/signals.h"

namespace tiltproof::faults {

class FaultSchedule {
 public:
  struct Lines {
    std::int64_t baud = 921'600;            // of the main line; 0 = ideal
    std::int64_t reference_baud = 921'600;  // of the reference line
  };

  // Throws std::invalid_argument, naming fault and key, when Validate() finds anything.
  FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed, const Lines& lines);
  FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed)
      : FaultSchedule(specs, seed, Lines{}) {}
  ~FaultSchedule();
  FaultSchedule(FaultSchedule&&) noexcept;
  FaultSchedule& operator=(FaultSchedule&&) noexcept;

  // What stands in one direction; null when no fault does. Lives as long as the schedule, moved or not.
  link::ChunkStage* Stage(link::Direction direction);

  // When more is to wait in a direction than link::kLineBytesMax: the faults that have put more bytes there than were
  // sent, and those that have kept some for later.
  struct Crowd {
    std::vector<std::size_t> multipliers, holders;
  };
  Crowd CrowdOf(link::Direction direction) const;

  // The boot time of t = 0. Until it is known, frames and received bytes are inside windows without a start
  // only.
  void SetOrigin(TimeNs boot_time_of_t0);

  // A sample that is about to be sent. `t` may be kPowerOn, for before t = 0: the record then has the time of
  // `boot_time`, which matters for nothing else.
  void EditSensors(TimeNs t, Sensors& sensors, TimeNs boot_time = 0);

  // The command in force from `t`. `new_command` false: the same command as last time, at the edge of a
  // window; it is neither counted nor drawn for again.
  void EditActuators(TimeNs t, ActuatorsTruth& actuators, bool new_command = true);

  // The first begin or end of an actuator fault's window after `t`, when the command in force must be edited
  // anew; kNever when there is none.
  TimeNs NextEdge(TimeNs t) const;

  // Bytes that arrive back to back at the firmware's receiver, the last of them at `last_arrival` (boot time):
  // what becomes of each, `marks` of the same size. To be called with every byte of the main line to the
  // client and of the reference line, in order; how they are spread over calls matters not. A byte bears one
  // mark: of several faults that pick it, that of the first in the file.
  void MarkReceived(link::Direction direction, TimeNs last_arrival, std::span<const std::uint8_t> bytes,
                    std::vector<ReceiveMark>& marks);

  // A command of faults/node_command.h or faults/device_command.h was carried out at `t`, in simulation time; `what` says how.
  void Count(std::size_t fault, TimeNs t, std::string what);

  // Whether `t` is inside the window of the fault (its index in the scenario).
  bool IsActive(std::size_t fault, TimeNs t) const;

  // How often each fault changed something (harness.null: was picked).
  const std::vector<std::int64_t>& ActivationCounts() const;
  // Those kept (faults/recorder.h) of each fault, the first kActivationsMax at most, in order of time, in simulation time;
  // `origin_ns` is the boot time of t = 0. Leaves none.
  std::vector<Activation> TakeActivations(TimeNs origin_ns);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tiltproof::faults
