#include "harness/scenario/fault_support.h"

#include "faults/registry.h"

namespace tiltproof::harness {

using faults::Needs;

std::optional<std::string> Unsupported(const faults::FaultType& type, const ClientAbilities& abilities) {
  const bool emulated = abilities.client == ClientKind::kEmulator;
  switch (type.needs) {
    case Needs::kNothing:
      return std::nullopt;
    case Needs::kNodes:
      if (abilities.realtime) return std::nullopt;
      return "acts on a node, which in lockstep is no process: it needs --mode realtime";
    case Needs::kReset:
      if (emulated || (abilities.client == ClientKind::kLibrary && !abilities.realtime)) return std::nullopt;
      return "needs a client that can be reset: fly it with --client qemu, or in lockstep with host or "
             "library:FILE";
    case Needs::kProcessor:
      if (emulated) return std::nullopt;
      return "needs an emulated board: fly it with --client qemu";
    case Needs::kEmulation:
      if (emulated && !abilities.realtime) return std::nullopt;
      if (emulated) return "needs the emulated board at exact virtual times: fly it with --mode lockstep";
      return "needs an emulated board: fly it with --client qemu, in lockstep";
    case Needs::kParityLine:
      return "needs a line with a parity bit: all lines are 8N1, where no receiver checks parity, so no "
             "client can have this fault";
  }
  return std::nullopt;
}

std::string FaultPlace(const Scenario& scenario, std::size_t fault) {
  const faults::FaultSpec& spec = scenario.faults[fault];
  const std::string place = fault < scenario.fault_places.size() ? scenario.fault_places[fault] + ": " : "";
  return place + "fault '" + spec.id + "' (" + spec.type + ")";
}

std::vector<std::string> UnsupportedFaults(const Scenario& scenario, const ClientAbilities& abilities) {
  std::vector<std::string> problems;
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const faults::FaultType* type = faults::FindFaultType(scenario.faults[i].type);
    const auto problem = type == nullptr ? std::nullopt : Unsupported(*type, abilities);
    if (problem) problems.push_back(FaultPlace(scenario, i) + " " + *problem);
  }
  return problems;
}

}  // namespace tiltproof::harness
