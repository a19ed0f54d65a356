#include "harness/protocol/line_load.h"

#include <algorithm>

#include "link/check.h"

namespace tiltproof::harness {

using link::Direction;
using link::MessageKind;
using link::MessageType;

FrameBytes FrameBytesOf(const link::Framing& framing, std::size_t payload_bytes) {
  const std::size_t bytes = payload_bytes + framing.check_bytes();
  if (framing.name() == "hdlc") return {bytes + 2, 2 * bytes + 2};
  if (framing.name() == "cobs") {
    constexpr std::size_t kBlockBytes = 254;
    return {bytes + 2, bytes + 2 + (bytes > 0 ? (bytes - 1) / kBlockBytes : 0)};
  }
  Check(framing.name() == "length_prefixed", "a framing whose length is known");
  const std::size_t header_bytes = framing.Encode({}).size() - framing.check_bytes();
  return {bytes + header_bytes, bytes + header_bytes};
}

std::optional<double> CountEachPeriod(const link::Protocol& protocol, const MessageType& type) {
  if (type.period_ns > 0)
    return static_cast<double>(protocol.control_period_ns) / static_cast<double>(type.period_ns);
  switch (type.direction) {
    case Direction::kReference:
      return 1;
    case Direction::kToClient:
      if (std::any_of(protocol.messages.begin(), protocol.messages.end(),
                      [&](const MessageType& each) { return each.reply == type.name; }))
        return 1;
      return std::nullopt;
    case Direction::kToPlant:
      if (!type.reply.empty() || type.kind == MessageKind::kActuators) return 1;
      return std::nullopt;
  }
  return std::nullopt;
}

LineLoad LineLoadOf(const link::Protocol& protocol, Direction direction) {
  LineLoad load;
  for (const MessageType& type : protocol.messages) {
    if (type.direction != direction) continue;
    const double count = CountEachPeriod(protocol, type).value_or(0);
    const FrameBytes frame = FrameBytesOf(*protocol.framing, type.payload_bytes);
    load.bytes += count * static_cast<double>(frame.least);
    load.bytes_max += count * static_cast<double>(frame.most);
  }
  return load;
}

}  // namespace tiltproof::harness
