#include "faults/volume.h"

#include <algorithm>
#include <array>

#include "faults/model.h"
#include "faults/registry.h"
#include "link/messages.h"

namespace tiltproof::faults {
namespace {

using link::Direction;
using link::MessageKind;

struct Traffic {
  Direction direction;
  MessageKind kind;
  std::size_t message_bytes;
};
// What is sent again and again. A frame has two flags and two bytes of check beside its message, at least.
constexpr std::array kTraffic = {
    Traffic{Direction::kToPlant, MessageKind::kSensors, link::kIdBytes},
    Traffic{Direction::kToPlant, MessageKind::kActuators, link::kActuatorMessageBytes},
    Traffic{Direction::kToClient, MessageKind::kReply, link::kSensorMessageBytes},
    Traffic{Direction::kReference, MessageKind::kReference, link::kReferenceMessageBytes}};
constexpr std::size_t kFramingBytes = 4;
// Within this time such a frame is sent.
constexpr TimeNs kSurelySentNs = 24 * kNsPerMs;

bool Reaches(Target target, Direction direction) {
  switch (target) {
    case Target::kToClient:
      return direction == Direction::kToClient;
    case Target::kToPlant:
      return direction == Direction::kToPlant;
    case Target::kBoth:
      return direction != Direction::kReference;
    case Target::kReference:
      return direction == Direction::kReference;
    case Target::kNone:
      return false;
  }
  return false;
}

bool DoublesAll(const FaultSpec& spec, const FaultType& type) {
  return type.volume == Volume::kDoubles && spec.every_nth_count == 1 && spec.probability >= 1.0 &&
         ResolvedParameters(spec, type).Number("probability") >= 1.0;
}

// The faults on that traffic in the time from `begin_ns` on, when they are too much.
std::vector<std::size_t> TooMuchAt(TimeNs begin_ns, const Traffic& traffic,
                                   const std::vector<FaultSpec>& specs,
                                   const std::vector<std::size_t>& acting_order) {
  const TimeNs end_ns = begin_ns + kSurelySentNs;
  std::vector<std::size_t> doubling;
  std::size_t bytes = traffic.message_bytes + kFramingBytes;
  for (const std::size_t fault : acting_order) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = *FindFaultType(spec.type);
    const bool sees = Reaches(ResolvedTarget(spec, type), traffic.direction) &&
                      (!spec.message || *spec.message == traffic.kind) && spec.start_ns < end_ns &&
                      spec.end_ns > begin_ns;
    if (!sees) continue;
    if (type.volume == Volume::kMayLose) return {};
    if (!DoublesAll(spec, type) || spec.start_ns > begin_ns || spec.end_ns < end_ns) continue;
    doubling.push_back(fault);
    bytes *= 2;
    if (bytes > link::kLineBytesMax) return doubling;
  }
  return {};
}

}  // namespace

std::optional<TooMuch> CertainOverfull(const std::vector<FaultSpec>& specs, TimeNs duration_ns) {
  std::vector<std::size_t> acting_order;
  for (std::size_t fault = 0; fault < specs.size(); ++fault)
    if (FindFaultType(specs[fault].type)->on_wire()) acting_order.push_back(fault);
  std::stable_sort(acting_order.begin(), acting_order.end(), [&specs](std::size_t a, std::size_t b) {
    return FindFaultType(specs[a].type)->stage < FindFaultType(specs[b].type)->stage;
  });
  for (const Traffic& traffic : kTraffic) {
    // Most are active at once when one has just begun.
    for (const std::size_t fault : acting_order) {
      const TimeNs begin_ns = std::max<TimeNs>(specs[fault].start_ns, 0);
      if (begin_ns > duration_ns - kSurelySentNs) continue;
      std::vector<std::size_t> too_much = TooMuchAt(begin_ns, traffic, specs, acting_order);
      if (!too_much.empty()) return TooMuch{traffic.direction, std::move(too_much)};
    }
  }
  return std::nullopt;
}

}  // namespace tiltproof::faults
