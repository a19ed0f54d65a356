#include "harness/run/receiving_end.h"

#include <algorithm>

#include "harness/run/hash.h"
#include "link/messages.h"

namespace tiltproof::harness {

ReceivingEnd::ReceivingEnd(link::Direction direction, link::Dialect dialect, bool faulty)
    : direction_(direction), dialect_(dialect), faulty_(faulty) {}

void ReceivingEnd::OnSent(const link::Chunk& chunk) {
  const auto number = static_cast<std::size_t>(counts_.frames_sent++);
  if (faulty_) recent_[number % recent_.size()] = chunk.bytes;
  if (!faulty_ && !on_sent_payload_) return;
  sent_decoder_.Decode(chunk.number, chunk.bytes, [this](const link::FrameEvent& event, std::uint64_t frame) {
    if (event.status != link::FrameStatus::kOk) return;
    if (faulty_) sent_[Fnv1a(event.payload)].push_back(next_number_++);
    if (on_sent_payload_) on_sent_payload_(frame, event.payload);
  });
}

void ReceivingEnd::OnDelivered(const link::Chunk& chunk) {
  if (!faulty_ || chunk.number + recent_.size() < static_cast<std::uint64_t>(counts_.frames_sent)) return;
  const auto& sent = recent_[chunk.number % recent_.size()];
  if (sent.size() == chunk.bytes.size()) {
    for (std::size_t i = 0; i < sent.size(); ++i)
      counts_.bytes_corrupted += sent[i] != chunk.bytes[i] ? 1 : 0;
    return;
  }
  // Length of the longest common subsequence, row by row: what is left of the delivered bytes was changed or
  // inserted.
  std::vector<std::int64_t> row(sent.size() + 1, 0);
  for (const std::uint8_t byte : chunk.bytes) {
    std::int64_t diagonal = 0;
    for (std::size_t i = 0; i < sent.size(); ++i) {
      const std::int64_t above = row[i + 1];
      row[i + 1] = sent[i] == byte ? diagonal + 1 : std::max(above, row[i]);
      diagonal = above;
    }
  }
  counts_.bytes_corrupted += static_cast<std::int64_t>(chunk.bytes.size()) - row.back();
}

TimeNs ReceivingEnd::ResyncMax(TimeNs end) const {
  return rejected_since_ns_ == kNever ? resync_max_ns_ : std::max(resync_max_ns_, end - rejected_since_ns_);
}

void ReceivingEnd::Receive(const link::Wire::Piece& piece, const OnAccepted& on_accepted,
                           const OnRejected& on_rejected) {
  const TimeNs arrival = piece.arrival_ns;
  decoder_.Decode(piece.number, piece.bytes, [&](const link::FrameEvent& event, std::uint64_t frame) {
    std::string_view reason;
    if (event.status != link::FrameStatus::kOk) {
      reason = Name(event.status);
    } else if (const link::MessageStatus status = Check(event.payload); status != link::MessageStatus::kOk) {
      reason = Name(status);
    }
    if (!reason.empty()) {
      ++counts_.frames_rejected;
      rejected_since_ns_ = std::min(rejected_since_ns_, arrival);
      if (on_rejected) on_rejected(arrival, reason);
      return;
    }
    ++counts_.frames_accepted;
    if (rejected_since_ns_ != kNever) {
      resync_max_ns_ = std::max(resync_max_ns_, arrival - rejected_since_ns_);
      rejected_since_ns_ = kNever;
    }
    if (faulty_) AuditAccepted(event.payload);
    if (on_accepted) on_accepted(arrival, frame, event.payload);
  });
}

link::MessageStatus ReceivingEnd::Check(std::span<const std::uint8_t> payload) const {
  switch (direction_) {
    case link::Direction::kToPlant: {
      link::ClientMessage message;
      return DecodeClientMessage(dialect_, payload, message);
    }
    case link::Direction::kToClient: {
      Sensors sensors;
      return link::DecodeSensors(payload, sensors);
    }
    case link::Direction::kReference: {
      Reference reference;
      return link::DecodeReference(payload, reference);
    }
  }
  return link::MessageStatus::kUnknownId;
}

void ReceivingEnd::AuditAccepted(std::span<const std::uint8_t> payload) {
  const auto found = sent_.find(Fnv1a(payload));
  if (found == sent_.end()) {
    ++wrong_count_;
    return;
  }
  const auto& numbers = found->second;
  const auto next = std::upper_bound(numbers.begin(), numbers.end(), last_accepted_number_);
  if (next == numbers.end()) {
    ++stale_count_;
  } else {
    last_accepted_number_ = *next;
  }
}

}  // namespace tiltproof::harness
