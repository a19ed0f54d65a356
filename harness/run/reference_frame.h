// A reference as the base station sends it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "harness/reference/reference_point.h"
#include "harness/run/message_binding.h"
#include "harness/run/message_order.h"
#include "link/protocol.h"

namespace tiltproof::harness {

class ReferenceFramer {
 public:
  // `protocol` must outlive it.
  explicit ReferenceFramer(const link::Protocol& protocol) : protocol_(&protocol), stamps_(protocol) {
    if (const link::MessageType* type = protocol.Find(link::MessageKind::kReference))
      message_.emplace(protocol, *type, ReferenceSignals());
  }

  // `now`: boot time of the sender. Empty when the protocol has no references.
  std::vector<std::uint8_t> Frame(const ReferencePoint& reference, BootTime now) {
    if (!message_) return {};
    std::vector<double> values = message_->Values(ToRow(reference));
    stamps_.Write(message_->type(), now, values);
    return protocol_->framing->Encode(protocol_->Encode(message_->type(), values).span());
  }

 private:
  const link::Protocol* protocol_;
  MessageStamps stamps_;
  std::optional<MessageBinding> message_;
};

}  // namespace tiltproof::harness
