#include "harness/run/message_binding.h"

#include <fmt/format.h>

#include <algorithm>

#include "harness/reference/reference_point.h"

namespace tiltproof::harness {

const SignalTable& TableOf(const link::MessageType& type, const VehicleSignals& vehicle) {
  switch (type.direction) {
    case link::Direction::kToPlant:
      return vehicle.inputs;
    case link::Direction::kToClient:
      return vehicle.sensors;
    case link::Direction::kReference:
      break;
  }
  return ReferenceSignals();
}

std::string UnsuitableProtocol(const link::Protocol& protocol, const VehicleSignals& vehicle) {
  std::vector<std::string> missing, left_out;
  const auto add = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const link::MessageType& type : protocol.messages)
    for (const link::MessageField& field : type.fields)
      if (!TableOf(type, vehicle).Find(field.signal)) add(missing, field.signal);
  const link::MessageType& actuators = *protocol.Find(link::MessageKind::kActuators);
  for (const Signal& input : vehicle.inputs)
    if (std::none_of(actuators.fields.begin(), actuators.fields.end(),
                     [&](const link::MessageField& field) { return field.signal == input.name; }))
      add(left_out, input.name);
  std::vector<std::string> reasons;
  if (!missing.empty())
    reasons.push_back(
        fmt::format("its messages carry {}, which this vehicle does not have", fmt::join(missing, ", ")));
  if (!left_out.empty())
    reasons.push_back(
        fmt::format("its actuator message does not carry this vehicle's {}", fmt::join(left_out, ", ")));
  if (reasons.empty()) return {};
  return fmt::format("the protocol '{}' does not suit the vehicle: {}", protocol.name,
                     fmt::join(reasons, "; "));
}

}  // namespace tiltproof::harness
