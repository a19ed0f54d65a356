// The faults of a scenario, ready to act. They depend only on data and a seed.
//
//   FaultSchedule faults(scenario.faults, scenario.seed, {.baud = 921600});
//   Wire wire(config, Direction::kToClient, protocol, faults.Filter(Direction::kToClient));
//   faults.SetOrigin(Origin(boot_time_of_t0));
//   faults.EditSensors(t, values);               // for each sample that is sent
//   faults.EditInput(t, input, new_command);     // for each step of the plant
//   plant.Step(input, faults.DisturbanceOf(t));
//   faults.MarkReceived(Direction::kToClient, arrival, bytes, marks);  // what reaches the firmware's receiver
//
// Faults on nodes and on the device have their windows and counts here, but act elsewhere
// (faults/node_command.h, faults/device_command.h).
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
#include "faults/fault_event.h"
#include "faults/model.h"
#include "link/chunk.h"
#include "link/disturbance.h"
#include "link/protocol.h"
#include "link/signal_table.h"

namespace tiltproof::faults {

// The use that a flight makes of its schedules.
struct ScheduleUse {
  bool grows = false;                    // Add() will be called
  bool keeps_activations = true;         // false: they are only counted, because nothing reads them
  std::optional<std::size_t> open = {};  // the fault that Give() gives
};

class FaultSchedule {
 public:
  // The part of the flight in which these faults act.
  struct Place {
    std::int64_t baud = 921'600;                          // of the main line; 0 = ideal
    std::int64_t reference_baud = 921'600;                // of the reference line
    link::CharacterFormat character = {};                 // of both
    std::shared_ptr<const link::Protocol> protocol = {};  // of the lines; faults on these need it
    // The vehicle's signals, where the plant is; without them the faults on the vehicle are only counted
    // here.
    std::optional<VehicleSignals> signals = {};
    TimeNs step_ns = 4 * kNsPerMs;  // of the plant
    // The client that the faults belong to; faults of another client do not act here. Empty: the flight's
    // only client.
    std::string_view client = {};
    ScheduleUse use = {};
    // The line between boards that the faults belong to; the others do not act here. Empty: the lines of a client.
    // `kToPlant` is then the way to its second end, `kToClient` that to its first.
    std::string_view line = {};
  };

  // Throws std::invalid_argument, naming fault and key, when Validate() finds anything.
  FaultSchedule(const std::vector<FaultSpec>& specs, std::uint64_t seed, const Place& place);
  ~FaultSchedule();
  FaultSchedule(FaultSchedule&&) noexcept;
  FaultSchedule& operator=(FaultSchedule&&) noexcept;

  // One more fault, which depends on the clock alone. Its index is the next. It acts as if the schedule had been made with
  // it behind the others, if its window begins after all that has passed so far. Only in a schedule that grows. Throws as
  // the constructor does.
  void Add(const FaultSpec& spec);
  // The open fault, before its window begins. It acts as if the schedule had been made with it. It differs from the
  // fault that it replaces only in its parameters and its window's end, and it edits what passes.
  void Give(const FaultSpec& spec);

  // The filter of one direction; null when no fault acts there, and none can come. Lives as long as the schedule, even if that
  // is moved.
  link::ChunkFilter* Filter(link::Direction direction);

  // True if bytes may arrive there that differ from those that were sent there.
  bool MayAlter(link::Direction direction) const;
  // Frames that faults of this direction have sent back to the sender since the last call, with their times and
  // numbers. They travel in the other direction of the main line, which applies no fault to them.
  std::vector<link::Chunk> TakeSentBack(link::Direction direction);

  // For a direction in which more than link::kLineBytesMax is to wait: the faults that put more bytes there
  // than were sent, and those that kept some for later.
  struct Crowd {
    std::vector<std::size_t> multipliers, holders;
  };
  Crowd CrowdOf(link::Direction direction) const;

  // Until the origin is known, frames and received bytes are only inside windows without a start.
  void SetOrigin(Origin origin);

  // The next three need a place with signals; rows are in the order of its tables.
  //
  // A sample that is about to be sent. `t` may be kPowerOn, meaning before t = 0: the record then has the
  // time of `boot_time`, which has no other use.
  void EditSensors(TimeNs t, std::span<double> values, BootTime boot_time = {});

  // The input of the step that begins at `t`; call it once per step. `new_command` false: the command is that
  // of the previous step; it is neither counted nor drawn for again.
  void EditInput(TimeNs t, std::span<double> input, bool new_command = true);

  // The disturbance of the vehicle during the step that begins at `t`; call it once per step.
  Disturbance DisturbanceOf(TimeNs t);

  // Bytes that arrive back to back at the firmware's receiver, the last of them at `last_arrival`. Sets
  // `marks` to the receiver's mark of each byte. Call it with every byte of the main line to the client and
  // of the reference line, in order; the result does not depend on how the bytes are split over calls. A byte
  // has one mark: of several faults that pick it, the first in the file decides, and a parity error of the line
  // (link::Chunk::parity_errors) shows where no fault picks the byte.
  void MarkReceived(link::Direction direction, BootTime last_arrival, std::span<const std::uint8_t> bytes,
                    std::vector<ReceiveMark>& marks, std::span<const std::uint8_t> parity_errors = {});

  // A command of faults/node_command.h or faults/device_command.h was carried out at `t`, in simulation time;
  // `what` describes it.
  void Count(std::size_t fault, TimeNs t, std::string what);

  // Events in this schedule since the last call that the other parts' schedules must hear; this
  // one has heard it already. Nothing before t = 0 is known.
  std::vector<FaultEvent> PollEvents();
  // Events from other parts, and conditions.
  void Hear(std::span<const FaultEvent> events);

  // True if the fault (its index in the scenario) is active at `t`.
  bool IsActive(std::size_t fault, TimeNs t) const;

  // The number of times that each fault changed something (for harness.null: that it was picked).
  const std::vector<std::int64_t>& ActivationCounts() const;
  // The kept activations (faults/recorder.h) of each fault, at most the first kActivationsMax, in order of
  // time, in simulation time. Without t = 0, the times of a line's activations count from power-on. Removes
  // them from the schedule.
  std::vector<Activation> TakeActivations(Origin origin = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tiltproof::faults
