#include "faults/volume.h"

#include <algorithm>

#include "faults/registry.h"

namespace tiltproof::faults {
namespace {

using link::Direction;

// Within this many periods every periodic message has been sent.
constexpr int kSurelySentPeriods = 2;

bool DoublesAll(const FaultSpec& spec, const FaultType& type) {
  return type.As<WireKind>()->volume == Volume::kDoubles && spec.every_nth_count == 1 &&
         spec.probability >= 1.0 && spec.period_ns == kNever && !WaitsForEvent(spec) &&
         ResolvedParameters(spec, type).Number("probability") >= 1.0;
}

// The faults on that message from `begin_ns` to `end_ns`, when they are too much.
std::vector<std::size_t> TooMuchAt(TimeNs begin_ns, TimeNs end_ns, const link::Protocol& protocol,
                                   const link::MessageType& message, const std::vector<FaultSpec>& specs,
                                   const std::vector<std::size_t>& acting_order) {
  std::vector<std::size_t> doubling;
  // Zeros make the shortest frame.
  std::size_t bytes = protocol.framing->Encode(std::vector<std::uint8_t>(message.payload_bytes)).size();
  for (const std::size_t fault : acting_order) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = *FindFaultType(spec.type);
    const bool sees = Reaches(ResolvedTarget(spec, type), message.direction) &&
                      (spec.message.empty() || FindMessage(protocol, spec.message) == &message) &&
                      spec.start_ns < end_ns && spec.end_ns > begin_ns;
    if (!sees) continue;
    if (type.As<WireKind>()->volume == Volume::kMayLose) return {};
    if (!DoublesAll(spec, type) || spec.start_ns > begin_ns || spec.end_ns < end_ns) continue;
    doubling.push_back(fault);
    bytes *= 2;
    if (bytes > link::kLineBytesMax) return doubling;
  }
  return {};
}

}  // namespace

std::optional<TooMuch> CertainOverfull(const std::vector<FaultSpec>& specs, TimeNs duration_ns,
                                       const link::Protocol& protocol) {
  std::vector<std::size_t> acting_order;
  const auto wire = [&specs](std::size_t fault) { return FindFaultType(specs[fault].type)->As<WireKind>(); };
  for (std::size_t fault = 0; fault < specs.size(); ++fault)
    if (wire(fault) != nullptr && specs[fault].line.empty()) acting_order.push_back(fault);
  std::stable_sort(acting_order.begin(), acting_order.end(), [&wire](std::size_t a, std::size_t b) {
    return wire(a)->wire_layer < wire(b)->wire_layer;
  });
  for (const link::MessageType& message : protocol.messages) {
    // Not sent again and again.
    if (message.kind == link::MessageKind::kStart || message.kind == link::MessageKind::kOther) continue;
    const TimeNs surely_sent_ns =
        kSurelySentPeriods * std::max(protocol.control_period_ns, message.period_ns);
    // Most are active at once when one has just begun.
    for (const std::size_t fault : acting_order) {
      const TimeNs begin_ns = std::max<TimeNs>(specs[fault].start_ns, 0);
      if (begin_ns > duration_ns - surely_sent_ns) continue;
      std::vector<std::size_t> too_much =
          TooMuchAt(begin_ns, begin_ns + surely_sent_ns, protocol, message, specs, acting_order);
      if (!too_much.empty()) return TooMuch{message.direction, std::move(too_much)};
    }
  }
  return std::nullopt;
}

}  // namespace tiltproof::faults
