// A fault type: one function in faults/models/<layer>/<name>.cpp returns it, and one line in
// faults/registry.cpp names that function.
//
// Its kind says where the fault acts, and has only the fields that such a fault needs. Code that applies a
// fault accepts only the kinds that it can apply: the compiler rejects the others.
//
//   FaultType SensorBias() {
//     return {.name = "sensor.bias", ..., .kind = SensorKind{.make = MakeBias}};
//   }
//
//   if (const auto* wire = type.As<WireKind>()) faults_of_wire.Add(*wire, ...);
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "faults/clock_action.h"
#include "faults/device_command.h"
#include "faults/fault.h"
#include "faults/model.h"
#include "faults/node_command.h"
#include "faults/parameters.h"

namespace tiltproof::faults {

// The order in which faults act on the wire.
enum class WireLayer : std::uint8_t { kFrame, kByte, kTiming };
std::string_view Name(WireLayer layer);

// The change that a fault on the wire makes to the number of bytes.
enum class Volume : std::uint8_t {
  kKeeps,    // the same number goes on, or more
  kMayLose,  // fewer may go on, or later
  kDoubles,  // with its parameter `probability` at 1, exactly twice as many go on
};

struct Problem {
  // The key of the fault in the scenario file: "type", "target", "end_s", "message", ..., "parameters" for
  // what is missing there, "parameters.<name>" for one parameter.
  std::string key;
  std::string message;
};

// Edits the frames that travel in one direction of a line.
struct WireKind {
  WireLayer wire_layer{};
  std::unique_ptr<WireModel> (*make)(const WireSetup&) = nullptr;
  std::optional<Target> default_target = {};  // without it the scenario must state a target
  Volume volume = Volume::kKeeps;
  bool remembers = false;        // its model has Pass() and Release()
  bool acts_on_overlap = false;  // any part of the frame in the window counts, not its first byte
  bool sends_back = false;       // its model uses WireContext::sent_back
  std::optional<link::ByteRole> needs_role = {};  // that bytes of the protocol's frames must have
  // The reason that valid parameters cannot do what they ask for with the messages of that protocol; null: they
  // always can.
  std::optional<Problem> (*refuses)(const Parameters&, const link::Protocol&) = nullptr;
};

// Marks bytes at the firmware's receiver, each with the probability given by the parameter `probability`.
struct ReceiverKind {
  ReceiveMark mark{};
  Target default_target = Target::kToClient;
};

// Edits samples before they are sent.
struct SensorKind {
  std::unique_ptr<SensorModel> (*make)(const SignalSetup&) = nullptr;
  bool always_counts = false;  // an activation is recorded even if nothing changed
  bool on_vector = false;      // its `signal` names a vector, and it acts on this as a whole
};

// Edits the input in force.
struct ActuatorKind {
  std::unique_ptr<ActuatorModel> (*make)(const SignalSetup&) = nullptr;
  bool needs_force = false;  // its `actuator` is a thrust or a torque, not the angle of a servo
};

// Disturbs the vehicle itself.
struct PlantKind {
  std::unique_ptr<PlantModel> (*make)(const SignalSetup&) = nullptr;
  bool is_wind = false;  // moves only a vehicle with drag
};

// Edits nothing: commands a node, only in real time. Its window is not before t = 0, and it has no trigger.
struct NodeKind {
  NodeAction (*make)(const Parameters&) = nullptr;
  bool asks_restart = false;  // each makes the firmware reboot once, at its start or later
};

// The same for the firmware's processor or its memory.
struct DeviceKind {
  DeviceAction (*make)(const DeviceSetup&) = nullptr;
  bool asks_restart = false;
  bool at_an_instant = false;  // a window is only the range from which the instant is drawn
};

// The same for the clock of the node that the parameter `node` names.
struct ClockKind {
  ClockAction (*make)(const Parameters&) = nullptr;
};

using FaultKind = std::variant<WireKind, ReceiverKind, SensorKind, ActuatorKind, PlantKind, NodeKind,
                               DeviceKind, ClockKind>;

// The rule for one end of a fault's window.
enum class Bound : std::uint8_t { kOptional, kRequired, kRefused };

// Requirement of a fault on the firmware's side. The harness refuses the fault before the flight where it cannot be
// carried out.
enum class Needs : std::uint8_t {
  kNothing,    // the harness does it by itself, with any client
  kNodes,      // processes of the harness: real time
  kReset,      // a client that can be reset
  kTask,       // a firmware whose task the harness can make late: a library or an emulated board, in lockstep
  kComputing,  // a firmware that states its computing time: a library or a program, in lockstep
  kProcessor,  // a processor that can be stopped, with memory that can be written
  kEmulation,  // the board's reset cause, watchdog and receiver, at exact virtual times
  kClock,      // depends on the parameter `node`: real time, or a client whose clock the harness provides
  kClockJump,  // the same, but the client must be one that the harness calls: a library
};

struct FaultType {
  std::string_view name;         // "<layer>.<what>"
  std::string_view summary;      // one sentence
  std::string_view semantics;    // what it models in the real world ("Models ..."), and what exactly happens
  std::string_view source = {};  // where the model is described: book, standard, paper, report
  std::vector<ParameterInfo> parameters = {};
  FaultKind kind;

  Bound start = Bound::kOptional, end = Bound::kOptional;
  std::string_view duration_ms = {};  // the parameter that sets the window's length, where `end` is refused

  // Neither a parameter nor the length of the window measures how severe it is.
  bool has_no_severity = false;

  Needs needs = Needs::kNothing;

  std::string_view layer() const { return name.substr(0, name.find('.')); }
  // Null when the fault is of another kind.
  template <class Kind>
  const Kind* As() const {
    return std::get_if<Kind>(&kind);
  }
  template <class... Kinds>
  bool IsOneOf() const {
    return (std::holds_alternative<Kinds>(kind) || ...);
  }
  // A command is given once, at one time: it has no target and no trigger.
  bool is_command() const { return IsOneOf<NodeKind, DeviceKind, ClockKind>(); }
  bool has_target() const { return IsOneOf<WireKind, ReceiverKind>(); }
  // Acts on one client's line, samples, board or nodes, not on the vehicle.
  bool is_of_client() const { return has_target() || IsOneOf<SensorKind, DeviceKind, ClockKind, NodeKind>(); }
  // The target of a fault that states none.
  std::optional<Target> default_target() const;
  // The measure of its severity: this parameter; null: the length of the window, if it has_severity().
  const ParameterInfo* severity_parameter() const;
  // Not when it happens at one instant, where no parameter measures it.
  bool has_severity() const;
  // A command that is not reverted at an end that the scenario states.
  bool happens_once() const;
  // True if it makes the firmware reboot once.
  bool asks_restart() const;
};

}  // namespace tiltproof::faults
