// Warnings about what a protocol or its lines cannot carry, each in one line with its place and the fix.
#pragma once

#include <string>
#include <vector>

#include "harness/run/message_range.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// "file:line:col" of the field's `signal`. The message alone where the protocol is not of a file.
std::string FieldPlace(const std::filesystem::path& protocol_file, const link::MessageType& message,
                       const link::MessageField& field);

// Inputs of hover that the protocol's actuator messages cannot carry. `protocol_file`: empty for a shipped protocol.
std::vector<std::string> HoverWarnings(const link::Protocol& protocol,
                                       const std::filesystem::path& protocol_file,
                                       const plant::VehicleModel& model);

// These, what the scenario's reference and start ask of the protocol, and lines that are too slow for it.
std::vector<std::string> RangeWarnings(const Scenario& scenario, const plant::VehicleModel& model);

}  // namespace tiltproof::harness
