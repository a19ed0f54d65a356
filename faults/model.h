// The interfaces of fault models. A model is one class in faults/models/<layer>/<name>.cpp, and a FaultType
// (faults/fault_type.h) describes it.
//
// A wire model is asked about one chunk at a time, by the faults of one wire (faults/schedule.h). A sensor
// model edits samples, an actuator model edits the input of each step, and a plant model says what disturbs
// the vehicle during a step (link/disturbance.h). A model does not decide when it is asked (window, every
// nth, probability, message) or how it is recorded. Some faults are only data, without a class: those on a
// node and on the device, which other parts carry out (faults/node_command.h, faults/device_command.h), and
// those of the firmware's receiver, which mark the bytes that arrive there (FaultSchedule::MarkReceived).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "faults/activity.h"
#include "faults/fault.h"
#include "faults/parameters.h"
#include "faults/random.h"
#include "link/chunk.h"
#include "link/disturbance.h"
#include "link/protocol.h"
#include "link/signal_table.h"
#include "link/time.h"

namespace tiltproof::faults {

// Limit of the text about one activation.
inline constexpr std::size_t kWhatBytesMax = 4000;

using link::LineRate;

// An open fault (FaultSchedule::Give) has to act: it was given too late.
struct OpenFaultActs : std::logic_error {
  OpenFaultActs() : std::logic_error("a fault acts before it is given") {}
};

// A wire model's knowledge besides the chunk.
struct WireContext {
  Random& random;  // only of this fault and this frame
  const Activity& activity;
  Origin origin;
  std::vector<link::Chunk>& sent_back;  // receives chunks that travel back to the sender
  std::string* what;       // receives a text about what was done, for a person; null when it is not read
  std::uint64_t pick = 0;  // of the frame, among those that the trigger has picked, from 0
  // True if the fault is active at any time in [begin, end).
  bool ActiveWithin(BootTime begin, BootTime end) const {
    return activity.Touches(origin.SimulationTime(begin), origin.SimulationTime(end));
  }
  // The same, for the time that byte `index` of the chunk takes.
  bool ActiveDuringByte(const link::Chunk& chunk, std::size_t index, const LineRate& rate) const {
    const auto before = static_cast<std::int64_t>(index);
    return ActiveWithin(chunk.begin_ns + rate.BytesTime(before), chunk.begin_ns + rate.BytesTime(before + 1));
  }
  // Beyond kWhatBytesMax the rest is "...".
  void Say(std::string_view text) const;
};

class WireModel {
 public:
  virtual ~WireModel() = default;
  // A chunk that the trigger picked. Appends to `out` the chunks that go on in its place.
  virtual void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) = 0;

  // For models that remember frames (WireKind::remembers): every chunk with the fault's `message` that the
  // trigger did not pick, outside the window too ...
  virtual void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) { out.push_back(std::move(chunk)); }
  // ... and, after each Act or Pass, the chance to add what was held back.
  virtual void Release(std::vector<link::Chunk>& /*out*/) {}
  // The total weight (link::WeightOf()) of the chunks that it keeps.
  virtual std::size_t held_bytes() const { return 0; }
};

// A sensor model's knowledge besides the values.
struct SampleContext {
  TimeNs time_ns;        // simulation time; kPowerOn before t = 0
  std::uint64_t number;  // of the sample, from 0
  TimeNs period_ns;      // since the previous sample; 0 for the first, and before t = 0
  const Activity& activity;
  Random& random;  // only of this fault and this sample
};

// Values are a row of numbers in the order of the vehicle's table of sensors. Those that have 32 bits when they are sent
// are rounded to these before and after (VehicleSignals::measured). Each sample goes to exactly one
// of the two functions, so a model that needs the past (a delay, a lower rate, a drop-out) sees all of it.
class SensorModel {
 public:
  virtual ~SensorModel() = default;
  // A sample that the trigger picked.
  virtual void Act(std::span<double> values, const SampleContext& context) = 0;
  // Any other sample, also outside the window.
  virtual void Pass(std::span<const double> /*values*/, const SampleContext& /*context*/) {}
};

// An actuator or plant model's knowledge besides the input.
struct StepContext {
  TimeNs time_ns;        // simulation time of the step's begin
  TimeNs step_ns;        // its length
  std::uint64_t number;  // of the step, from 0
  const Activity& activity;
  Random& random;  // only of this fault and this step
};

// The input is a row of numbers in the order of the vehicle's table of inputs, before saturation. Each step
// of the plant goes to exactly one of the two functions, so a model that starts from the input in force (a
// rate limit, a lag, a jam) knows it.
class ActuatorModel {
 public:
  virtual ~ActuatorModel() = default;
  // A step in the window, of a command that the trigger picked.
  virtual void Act(std::span<double> input, const StepContext& context) = 0;
  virtual void Pass(std::span<const double> /*input*/, const StepContext& /*context*/) {}
};

class PlantModel {
 public:
  virtual ~PlantModel() = default;
  // The disturbance of the plant during a step that the trigger picked.
  virtual Disturbance Act(const StepContext& context) = 0;
  // Any other step, also outside the window.
  virtual void Pass(const StepContext& /*context*/) {}
};

// Input to the factory of a sensor, actuator or plant model. Signals are given by name: their places are
// looked up once, here.
struct SignalSetup {
  const Parameters& parameters;
  const VehicleSignals& signals;
  std::uint64_t stream;  // key of the random stream, for what does not belong to one sample or step
};

// Treatment of a byte by the firmware's receiver. A byte that is not lost is delivered unchanged, with the flag
// set that the USART then shows (RM0090, section 30.3.3).
enum class ReceiveMark : std::uint8_t { kNone, kOverrun, kFraming, kNoise, kParity };
std::string_view Name(ReceiveMark mark);  // "none", "overrun", ...

// Input to the factory of a wire model.
struct WireSetup {
  const Parameters& parameters;
  LineRate rate;
  std::uint64_t stream;  // key of the random stream, for what does not belong to one frame
  // The description of the messages; it outlives the model.
  const link::Protocol& protocol;
  link::Direction direction;
};

}  // namespace tiltproof::faults
