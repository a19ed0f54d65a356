#include "harness/scenario/fault_support.h"

#include <algorithm>

#include "faults/registry.h"

namespace tiltproof::harness {

using faults::Needs;

namespace {

std::optional<std::string> UnsupportedClock(std::string_view node, bool jumps,
                                            const ClientAbilities& abilities) {
  if (node != "client") {
    if (abilities.realtime) return std::nullopt;
    return "acts on the clock of a node, and in lockstep there is one clock for all but the client: it needs "
           "--mode realtime";
  }
  if (!abilities.clock)
    return "acts on the client's clock, which in real time is its own: it needs host or library:FILE, or in "
           "lockstep "
           "program:CMD or, for a drift, an emulated board";
  if (jumps && !abilities.realtime && abilities.processor)
    return "lets the client's clock jump, and the processor of an emulated board would execute everything in "
           "between: fly it with host, library:FILE or program:CMD";
  return std::nullopt;
}

}  // namespace

std::optional<std::string> Unsupported(const faults::FaultSpec& fault, const faults::FaultType& type,
                                       const ClientAbilities& abilities) {
  switch (type.needs) {
    case Needs::kNothing:
      return std::nullopt;
    case Needs::kNodes:
      if (abilities.realtime) return std::nullopt;
      return "acts on a node, and lockstep has no node processes: it needs --mode realtime";
    case Needs::kReset:
      if (abilities.reset) return std::nullopt;
      return "needs a client that can be reset: fly it with --client qemu, or in lockstep with host, "
             "library:FILE or program:CMD";
    case Needs::kTask:
      if (abilities.task) return std::nullopt;
      return "delays the task of a firmware in virtual time: fly it in lockstep with host, library:FILE, "
             "program:CMD or an emulated board";
    case Needs::kComputing:
      if (abilities.computing) return std::nullopt;
      if (abilities.processor)
        return "stretches the computing time that a firmware states, and an image states none: its "
               "instructions take their time; device.task_delay and device.stall take the processor from it";
      if (abilities.realtime)
        return "stretches the computing time that a firmware states in lockstep; in real time computing "
               "takes "
               "what it takes";
      return "stretches the computing time that a firmware states, and this client states none: fly it with "
             "host, library:FILE or program:CMD";
    case Needs::kProcessor:
      if (abilities.processor) return std::nullopt;
      return "needs an emulated board: fly it with --client qemu";
    case Needs::kEmulation:
      if (abilities.exact_times) return std::nullopt;
      if (abilities.processor)
        return "needs the emulated board at exact virtual times: fly it with --mode lockstep";
      return "needs an emulated board: fly it with --client qemu, in lockstep";
    case Needs::kClock:
    case Needs::kClockJump:
      return UnsupportedClock(faults::ResolvedParameters(fault, type).Choice("node"),
                              type.needs == Needs::kClockJump, abilities);
  }
  return std::nullopt;
}

namespace {

// Where the plant is, on samples and inputs: there conditions and activations are known at once in real time too.
bool ActsAtPlant(const faults::FaultSpec& fault) {
  const faults::FaultType* type = faults::FindFaultType(fault.type);
  return type != nullptr && !type->is_command() && !type->has_target();
}

// Reason that this fault cannot wait for what it waits for; none: it can.
std::optional<std::string> UnsupportedWaiting(const Scenario& scenario, const faults::FaultSpec& fault,
                                              const ClientAbilities& abilities) {
  if (!abilities.realtime || !faults::WaitsForEvent(fault)) return std::nullopt;
  if (!ActsAtPlant(fault))
    return "waits for a condition or another fault, of which only the plant's node knows in time in real "
           "time: "
           "faults of sensors and actuators can wait there, others need --mode lockstep";
  for (const faults::FaultSpec& other : scenario.faults)
    if (fault.after && other.id == fault.after->fault && !ActsAtPlant(other))
      return "waits for fault '" + other.id +
             "', of whose activation the plant's node does not know in time in real time: it needs --mode "
             "lockstep";
  return std::nullopt;
}

}  // namespace

namespace {

// The client's line, samples, board or receiver, or its end of a line between boards.
bool IsOn(const Scenario& scenario, const faults::FaultSpec& fault, std::size_t client) {
  const std::string id = scenario.client_id(client);
  if (fault.line.empty()) return fault.client.empty() || fault.client == id;
  if (!fault.line_end.empty()) return fault.line_end == id;
  return std::ranges::any_of(scenario.line_ends_of(client),
                             [&](const LineEndId& end) { return scenario.lines[end.line].id == fault.line; });
}

}  // namespace

std::string FaultPlace(const Scenario& scenario, std::size_t fault) {
  const faults::FaultSpec& spec = scenario.faults[fault];
  const std::string place = fault < scenario.fault_places.size() ? scenario.fault_places[fault] + ": " : "";
  return place + "fault '" + spec.id + "' (" + spec.type + ")";
}

std::vector<Problem> UnsupportedFaults(const Scenario& scenario,
                                       const std::vector<ClientAbilities>& abilities) {
  std::vector<Problem> problems;
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const faults::FaultType* type = faults::FindFaultType(scenario.faults[i].type);
    for (std::size_t client = 0; type != nullptr && client < abilities.size(); ++client) {
      if (!IsOn(scenario, scenario.faults[i], client)) continue;
      auto problem = Unsupported(scenario.faults[i], *type, abilities[client]);
      if (!problem) problem = UnsupportedWaiting(scenario, scenario.faults[i], abilities[client]);
      if (!problem) continue;
      problems.push_back({FaultPlace(scenario, i) + " " + *problem, *problem});
      break;
    }
  }
  return problems;
}

}  // namespace tiltproof::harness
