#include "harness/run/receiving_end.h"

#include <algorithm>

#include "harness/run/hash.h"

namespace tiltproof::harness {

ReceivingEnd::ReceivingEnd(const link::Protocol& protocol, link::Direction direction, bool faulty)
    : faulty_(faulty), receiver_(protocol, direction), sent_receiver_(protocol, direction) {}

void ReceivingEnd::OnSent(const link::Chunk& chunk) {
  const auto number = static_cast<std::size_t>(counts_.frames_sent++);
  if (!faulty_) {
    if (on_sent_frame_) on_sent_frame_({chunk.number, 0});
    return;
  }
  recent_[number % recent_.size()] = chunk.bytes;
  sent_receiver_.ReceiveFrames(chunk.number, chunk.bytes, [this](const MessageReceiver::Frame& frame) {
    if (frame.message == nullptr) return;
    const std::uint64_t hash = Fnv1a(frame.payload);
    sent_[hash].push_back(next_number_++);
    if (on_sent_frame_) on_sent_frame_({frame.number, hash});
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

TimeNs ReceivingEnd::ResyncMax(BootTime end) const {
  return rejected_since_ns_ == BootTime::Never() ? resync_max_ns_
                                                 : std::max(resync_max_ns_, end - rejected_since_ns_);
}

void ReceivingEnd::CountRejected(BootTime arrival) {
  ++counts_.frames_rejected;
  rejected_since_ns_ = std::min(rejected_since_ns_, arrival);
}

ReceivingEnd::FrameName ReceivingEnd::CountAccepted(BootTime arrival, const MessageReceiver::Frame& frame) {
  ++counts_.frames_accepted;
  if (rejected_since_ns_ != BootTime::Never()) {
    resync_max_ns_ = std::max(resync_max_ns_, arrival - rejected_since_ns_);
    rejected_since_ns_ = BootTime::Never();
  }
  if (!faulty_) return {frame.number, 0};
  const std::uint64_t hash = Fnv1a(frame.payload);
  Audit(hash);
  return {frame.number, hash};
}

void ReceivingEnd::Audit(std::uint64_t payload_hash) {
  const auto found = sent_.find(payload_hash);
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
