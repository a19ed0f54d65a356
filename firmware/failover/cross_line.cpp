#include "firmware/failover/cross_line.h"

#include <bit>

namespace tiltproof::firmware {
namespace {

constexpr std::uint8_t kRoleBits = 3;
constexpr std::uint8_t kHeardBit = 1 << 2;
constexpr std::uint8_t kLinkGoodBit = 1 << 3;
constexpr std::uint8_t kKeepsBit = 1 << 4;
constexpr std::uint8_t kReadyBit = 1 << 5;
constexpr std::uint8_t kUnknownBits = 0xC0;

// Bits of infinity; those of numbers that are not finite are no less.
constexpr std::uint32_t kInfinityBits = 0x7F80'0000;

void Store(std::uint8_t*& to, std::uint32_t value, unsigned bytes) {
  for (unsigned i = 0; i < bytes; ++i) *to++ = static_cast<std::uint8_t>(value >> 8 * i);
}
std::uint32_t Load(const std::uint8_t*& from, unsigned bytes) {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < bytes; ++i) value |= static_cast<std::uint32_t>(*from++) << 8 * i;
  return value;
}

}  // namespace

std::array<std::uint8_t, kCrossPayloadBytes> EncodeCross(const CrossMessage& message) {
  const Heartbeat& heartbeat = message.heartbeat;
  std::array<std::uint8_t, kCrossPayloadBytes> payload;
  std::uint8_t* to = payload.data();
  Store(to,
        static_cast<std::uint32_t>(heartbeat.role) | (heartbeat.heard ? kHeardBit : 0U) |
            (heartbeat.link_good ? kLinkGoodBit : 0U) | (heartbeat.keeps ? kKeepsBit : 0U) |
            (heartbeat.ready ? kReadyBit : 0U),
        1);
  Store(to, heartbeat.sequence, 2);
  Store(to, heartbeat.echo, 2);
  Store(to, heartbeat.claim_age, 4);
  for (const float integral : message.integrals) Store(to, std::bit_cast<std::uint32_t>(integral), 4);
  return payload;
}

std::optional<CrossMessage> DecodeCross(std::span<const std::uint8_t> payload) {
  if (payload.size() != kCrossPayloadBytes) return std::nullopt;
  const std::uint8_t* from = payload.data();
  const std::uint32_t flags = Load(from, 1);
  if ((flags & kUnknownBits) != 0 || (flags & kRoleBits) >= kRoleCount) return std::nullopt;
  CrossMessage message;
  message.heartbeat.role = static_cast<Role>(flags & kRoleBits);
  message.heartbeat.heard = (flags & kHeardBit) != 0;
  message.heartbeat.link_good = (flags & kLinkGoodBit) != 0;
  message.heartbeat.keeps = (flags & kKeepsBit) != 0;
  message.heartbeat.ready = (flags & kReadyBit) != 0;
  message.heartbeat.sequence = static_cast<std::uint16_t>(Load(from, 2));
  message.heartbeat.echo = static_cast<std::uint16_t>(Load(from, 2));
  message.heartbeat.claim_age = Load(from, 4);
  for (float& integral : message.integrals) {
    const std::uint32_t bits = Load(from, 4);
    if ((bits & 0x7FFF'FFFF) >= kInfinityBits) return std::nullopt;
    integral = std::bit_cast<float>(bits);
  }
  return message;
}

void CrossLine::Send(TimeNs now, const CrossMessage& message) {
  std::array<std::uint8_t, link::FrameBytesMax(kCrossPayloadBytes, link::FrameCheck::kCrc32)> wire;
  port_.Transmit(uart_, now, link::EncodeFrame(EncodeCross(message), wire, link::FrameCheck::kCrc32).bytes);
}

}  // namespace tiltproof::firmware
