// All fault types: what a scenario may ask for, and what the catalogue prints.
//
// To add one: a file faults/models/<layer>/<name>.cpp that defines a function returning its FaultType, and
// one line in registry.cpp that names that function. The conformance test runs over all of them.
//
//   for (const Problem& problem : Validate(spec)) Report(problem.key, problem.message);
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "faults/fault.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {

// In the order of the catalogue.
const std::vector<FaultType>& FaultTypes();
// Null when there is no type of that name.
const FaultType* FindFaultType(std::string_view name);

// For a name that was a type in the past: "was replaced by clock.drift ..."; empty for any other.
std::string_view WhyNoLonger(std::string_view name);

// True if what goes in that direction passes the target.
bool Reaches(Target target, link::Direction direction);

// The message that `message` of a fault names: by its name in the protocol, or by its role (link::MessageKind) when no
// other message has that. `sensors` is another word for `request`; `reply` is the only message that the server sends by
// itself, where it answers none. Null when there is none.
const link::MessageType* FindMessage(const link::Protocol& protocol, std::string_view name);
// The problem of a fault whose message the protocol does not have, or that does not travel there; otherwise empty.
std::string MessageProblem(const FaultSpec& spec, const FaultType& type, const link::Protocol& protocol);

// The names that a parameter of kind kField may have: the fields of the protocol's messages that travel to that
// target; of one message, if the fault names it.
std::vector<std::string> FieldNames(const link::Protocol& protocol, Target target,
                                    std::string_view message = {});

// The problem of a valid fault that the frames or the messages of that protocol make impossible; nullopt: none does.
std::optional<Problem> ProtocolProblem(const FaultSpec& spec, const link::Protocol& protocol);

// The possible targets of a fault, Target::kNone being "no target": the main line or the reference line for
// faults on the wire, none for others.
// The reason that a line between boards cannot have such a fault. `has_protocol`: that of its frames is named.
std::optional<std::string> LineProblem(const FaultType& type, bool has_protocol);
std::vector<Target> AcceptedTargets(const FaultType& type);
// The target of a fault on the wire, the type's default if it states none.
Target ResolvedTarget(const FaultSpec& spec, const FaultType& type);

// The parameters of a valid fault, the type's defaults filled in.
Parameters ResolvedParameters(const FaultSpec& spec, const FaultType& type);
// When a valid fault is active: as stated, or from its start for as long as one of its parameters says.
Window WindowOf(const FaultSpec& spec);

// All errors in a fault; empty when it can be scheduled.
std::vector<Problem> Validate(const FaultSpec& spec);
// The type of a valid fault; throws std::invalid_argument, naming fault and key, when the fault is not valid.
const FaultType& ValidType(const FaultSpec& spec);

// A parameter in one line: meaning, allowed values, unit, default.
std::string ParameterText(const ParameterInfo& info);
// All types as a Markdown page.
std::string CatalogueMarkdown();
// The section of one type in this page.
std::string Markdown(const FaultType& type);

}  // namespace tiltproof::faults
