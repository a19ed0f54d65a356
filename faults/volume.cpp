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

// A fault on the clients' wires, looked up once.
struct OnWire {
  std::size_t fault;
  const FaultSpec* spec;
  Target target;
  WireLayer layer;
  Volume volume;
  bool doubles_all;
};

std::vector<OnWire> InActingOrder(const std::vector<FaultSpec>& specs) {
  std::vector<OnWire> order;
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = *FindFaultType(spec.type);
    const WireKind* wire = type.As<WireKind>();
    if (wire != nullptr && spec.line.empty())
      order.push_back(
          {fault, &spec, ResolvedTarget(spec, type), wire->wire_layer, wire->volume, DoublesAll(spec, type)});
  }
  std::ranges::stable_sort(order, {}, &OnWire::layer);
  return order;
}

// The faults on that message from `begin_ns` to `end_ns`, when they are too much.
std::vector<std::size_t> TooMuchAt(TimeNs begin_ns, TimeNs end_ns, const link::Protocol& protocol,
                                   const link::MessageType& message,
                                   const std::vector<OnWire>& acting_order) {
  std::vector<std::size_t> doubling;
  // Zeros make the shortest frame.
  std::size_t bytes = protocol.framing->Encode(std::vector<std::uint8_t>(message.payload_bytes)).size();
  for (const OnWire& own : acting_order) {
    const FaultSpec& spec = *own.spec;
    const bool sees = Reaches(own.target, message.direction) && spec.start_ns < end_ns &&
                      spec.end_ns > begin_ns &&
                      (spec.message.empty() || FindMessage(protocol, spec.message) == &message);
    if (!sees) continue;
    if (own.volume == Volume::kMayLose) return {};
    if (!own.doubles_all || spec.start_ns > begin_ns || spec.end_ns < end_ns) continue;
    doubling.push_back(own.fault);
    bytes *= 2;
    if (bytes > link::kLineBytesMax) return doubling;
  }
  return {};
}

}  // namespace

bool DoublesBytes(const FaultSpec& spec) {
  const FaultType& type = *FindFaultType(spec.type);
  return type.As<WireKind>() != nullptr && spec.line.empty() && DoublesAll(spec, type);
}

std::optional<TooMuch> CertainOverfull(const std::vector<FaultSpec>& specs, TimeNs duration_ns,
                                       const link::Protocol& protocol) {
  const std::vector<OnWire> acting_order = InActingOrder(specs);
  for (const link::MessageType& message : protocol.messages) {
    // Not sent again and again.
    if (message.kind == link::MessageKind::kStart || message.kind == link::MessageKind::kOther) continue;
    const TimeNs surely_sent_ns =
        kSurelySentPeriods * std::max(protocol.control_period_ns, message.period_ns);
    // Most are active at once when one has just begun.
    for (const OnWire& begun : acting_order) {
      const TimeNs begin_ns = std::max<TimeNs>(begun.spec->start_ns, 0);
      if (begin_ns > duration_ns - surely_sent_ns) continue;
      std::vector<std::size_t> too_much =
          TooMuchAt(begin_ns, begin_ns + surely_sent_ns, protocol, message, acting_order);
      if (!too_much.empty()) return TooMuch{message.direction, std::move(too_much)};
    }
  }
  return std::nullopt;
}

}  // namespace tiltproof::faults
