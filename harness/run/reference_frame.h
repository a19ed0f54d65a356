// A reference as the base station sends it.
#pragma once

#include <cstdint>
#include <vector>

#include "harness/reference/reference_point.h"
#include "harness/run/message_binding.h"
#include "link/protocol.h"

namespace tiltproof::harness {

class ReferenceFramer {
 public:
  // `protocol` must outlive it.
  explicit ReferenceFramer(const link::Protocol& protocol)
      : protocol_(&protocol), message_(*protocol.Find(link::MessageKind::kReference), ReferenceSignals()) {}

  std::vector<std::uint8_t> Frame(const ReferencePoint& reference) const {
    const std::vector<double> row = ToRow(reference);
    return protocol_->framing->Encode(
        protocol_->Encode(message_.type(), message_.Values<double>(row)).span());
  }

 private:
  const link::Protocol* protocol_;
  MessageBinding message_;
};

}  // namespace tiltproof::harness
