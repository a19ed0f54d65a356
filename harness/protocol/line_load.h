// The bytes that a protocol puts on its lines: of each message, and in each control period.
//
//   const LineLoad load = LineLoadOf(*FindProtocol("paper"), link::Direction::kToClient);
//   const double share = LineTime_s(load.bytes, {.baud = 921600}) / 0.012;  // of the control period
#pragma once

#include <optional>

#include "link/character.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// Lengths of the frame of a payload: when no byte needs stuffing, and when all do that can.
struct FrameBytes {
  std::size_t least = 0, most = 0;
};
FrameBytes FrameBytesOf(const link::Framing& framing, std::size_t payload_bytes);

// The number of such messages in each control period: 1 for requests, their replies, actuators and references; the share of
// the period for a message that the server sends by itself. nullopt: the protocol does not say when the message is sent.
std::optional<double> CountEachPeriod(const link::Protocol& protocol, const link::MessageType& type);

// All messages of a direction, in one control period.
struct LineLoad {
  double bytes = 0, bytes_max = 0;
};
LineLoad LineLoadOf(const link::Protocol& protocol, link::Direction direction);

// Time that these bytes take one behind the other, in s: start bit, data bits, parity bit and stop bits of each. The rate
// is positive.
inline double LineTime_s(double bytes, const link::LineRate& rate) {
  return bytes * static_cast<double>(rate.character.bit_count()) / static_cast<double>(rate.baud);
}

}  // namespace tiltproof::harness
