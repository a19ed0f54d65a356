#include "firmware/reference_receiver.h"

#include <bit>
#include <utility>

#include "firmware/messages.h"

namespace tiltproof::firmware {
namespace {

float LittleEndianFloat(std::span<const std::uint8_t, 4> bytes) {
  return std::bit_cast<float>(
      static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8 |
      static_cast<std::uint32_t>(bytes[2]) << 16 | static_cast<std::uint32_t>(bytes[3]) << 24);
}

// The counterpart of link::DecodeReference for a receiver that trusts the checksum: exact length only.
link::MessageStatus ParseReference(std::span<const std::uint8_t> payload, Reference& reference) {
  if (payload.size() != link::kReferenceMessageBytes) return link::MessageStatus::kBadLength;
  for (const auto& field : kReferenceFields) {
    reference.*field.in_float = LittleEndianFloat(payload.first<4>());
    payload = payload.subspan(4);
  }
  return link::MessageStatus::kOk;
}

}  // namespace

void ReferenceReceiver::Receive(std::span<const std::uint8_t> bytes) {
  while (const auto event = decoder_.Next(bytes)) {
    if (event->status == link::FrameStatus::kOk) Accept(event->payload);
  }
}

void ReferenceReceiver::Accept(std::span<const std::uint8_t> payload) {
  const auto values = filter_.Values(payload);
  if (!values) return;
  Reference received;
  const link::MessageStatus status = checks_ == ValueChecks::kNone ? ParseReference(*values, received)
                                                                   : link::DecodeReference(*values, received);
  if (status != link::MessageStatus::kOk) return;
  filter_.Accept();
  received_ = received;
}

std::optional<Reference> ReferenceReceiver::TakeReference() { return std::exchange(received_, std::nullopt); }

}  // namespace tiltproof::firmware
