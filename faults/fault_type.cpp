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

bool FaultType::asks_restart() const {
  if (const auto* node = As<NodeKind>()) return node->asks_restart;
  if (const auto* device = As<DeviceKind>()) return device->asks_restart;
  return false;
}

}  // namespace tiltproof::faults
