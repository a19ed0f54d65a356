// The firmware's side limits the possible faults: a shared library can be reset but has no memory to flip
// bits in; a process in real time has neither. The harness refuses a scenario that asks for what its client
// cannot do, before the flight and with the fault's place:
//
//   for (const Problem& problem : UnsupportedFaults(scenario, {AbilitiesOf(client, realtime)}))
//     Report(problem.text);  // "s.yaml:6:20: fault 'x' (device.stall) needs an emulated board: ..."
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "faults/fault_type.h"
#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Reason that this fault of this type is not possible, and what to do; none when it is possible. Follows
// "fault 'x' (type) ".
std::optional<std::string> Unsupported(const faults::FaultSpec& fault, const faults::FaultType& type,
                                       const ClientAbilities& abilities);

// Reason that a scenario cannot be flown.
struct Problem {
  std::string text;  // with its place
  std::string why;   // without: the same for all scenarios that have it
};

// "s.yaml:6:20: fault 'x' (device.stall)"; without the place when the scenario was not read from a file.
std::string FaultPlace(const Scenario& scenario, std::size_t fault);

// One problem per fault of the scenario that is not possible, in the order of the file; with the place of the
// fault's type when the scenario was read from a file. `abilities`: those of each of the scenario's clients.
std::vector<Problem> UnsupportedFaults(const Scenario& scenario,
                                       const std::vector<ClientAbilities>& abilities);

}  // namespace tiltproof::harness
