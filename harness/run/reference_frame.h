// A reference as the base station sends it.
#pragma once

#include "harness/reference/reference_point.h"
#include "harness/run/framed.h"
#include "harness/run/message_binding.h"
#include "link/protocol.h"

namespace tiltproof::harness {

class ReferenceFramer {
 public:
  // `protocol` must outlive it.
  explicit ReferenceFramer(const link::Protocol& protocol)
      : protocol_(&protocol), message_(*protocol.Find(link::MessageKind::kReference), ReferenceSignals()) {}

  Framed Frame(const ReferencePoint& reference) const {
    const std::vector<double> row = ToRow(reference);
    return Framed(protocol_->Encode(message_.type(), message_.Values<double>(row)).span());
  }

 private:
  const link::Protocol* protocol_;
  MessageBinding message_;
};

}  // namespace tiltproof::harness
