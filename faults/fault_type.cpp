#include "faults/fault_type.h"

namespace tiltproof::faults {

std::string_view Name(WireLayer layer) {
  switch (layer) {
    case WireLayer::kFrame:
      return "frame";
    case WireLayer::kByte:
      return "byte";
    case WireLayer::kTiming:
      return "timing";
  }
  return "unknown";
}

std::optional<Target> FaultType::default_target() const {
  if (const auto* wire = As<WireKind>()) return wire->default_target;
  if (const auto* receiver = As<ReceiverKind>()) return receiver->default_target;
  return std::nullopt;
}

bool FaultType::happens_once() const {
  const auto* device = As<DeviceKind>();
  return is_command() && (end == Bound::kRefused || (device != nullptr && device->at_an_instant));
}

const ParameterInfo* FaultType::severity_parameter() const {
  if (has_no_severity) return nullptr;
  for (const ParameterInfo& info : parameters)
    if (info.severity) return &info;
  for (const ParameterInfo& info : parameters)
    if (!duration_ms.empty() && info.name == duration_ms) return &info;
  return nullptr;
}

bool FaultType::has_severity() const {
  if (has_no_severity) return false;
  const auto* device = As<DeviceKind>();
  const bool has_length = end != Bound::kRefused && (device == nullptr || !device->at_an_instant);
  return has_length || severity_parameter() != nullptr;
}

bool FaultType::asks_restart() const {
  if (const auto* node = As<NodeKind>()) return node->asks_restart;
  if (const auto* device = As<DeviceKind>()) return device->asks_restart;
  return false;
}

}  // namespace tiltproof::faults
