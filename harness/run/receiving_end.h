// The receiving end of a wire: decodes what arrives, checks the messages, and audits them against what was
// sent.
//
// It shadows the real receiver (the server, the client) with all checks of the protocol, so that the counters
// measure the protocol and not one firmware.
//
// The audit numbers the frames as sent. An accepted payload is
//   wrong  when it equals no payload sent so far in this direction: corruption that every check let through
//   stale  when it equals only payloads sent at or before the last one accepted: a repeat, or older than what
//          came already
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "harness/run/message_receiver.h"
#include "harness/run/run_log.h"
#include "link/chunk.h"
#include "link/wire.h"

namespace tiltproof::harness {

class ReceivingEnd {
 public:
  // `faulty`: a filter on this wire may edit bytes. Without one nothing accepted can be wrong, and there is
  // no audit.
  ReceivingEnd(const link::Protocol& protocol, link::Direction direction, bool faulty);

  // Identifies a frame: its number and its content. Where nothing edits bytes the number is enough, and the
  // hash is 0.
  struct FrameName {
    std::uint64_t number;        // MessageReceiver::Frame::number
    std::uint64_t payload_hash;  // 64-bit FNV-1a
    friend bool operator==(const FrameName&, const FrameName&) = default;
  };
  // Called with every message as sent; where nothing edits bytes, with every chunk.
  using OnSentFrame = std::function<void(const FrameName& name)>;
  void SetOnSentFrame(OnSentFrame on_sent_frame) { on_sent_frame_ = std::move(on_sent_frame); }

  // Taps of the wire.
  void OnSent(const link::Chunk& chunk);
  void OnDelivered(const link::Chunk& chunk);

  // Bytes that have arrived. Calls on_accepted(const FrameName&, const link::Message&) for each message, and
  // on_rejected(std::string_view reason) for each frame that is no message
  // (MessageReceiver::Frame::rejected).
  template <class OnAccepted, class OnRejected>
  void Receive(const link::Wire::Piece& piece, const OnAccepted& on_accepted, const OnRejected& on_rejected) {
    counts_.parity_errors += std::count(piece.parity_errors.begin(), piece.parity_errors.end(), 1);
    receiver_.ReceiveFrames(piece.number, piece.bytes, [&](const MessageReceiver::Frame& frame) {
      if (frame.message == nullptr) {
        CountRejected(piece.arrival_ns);
        on_rejected(frame.rejected);
      } else {
        on_accepted(CountAccepted(piece.arrival_ns, frame), *frame.message);
      }
    });
  }

  const DirectionCounts& counts() const { return counts_; }
  std::int64_t wrong_count() const { return wrong_count_; }
  std::int64_t stale_count() const { return stale_count_; }
  // Longest time from a rejection to the next accepted frame, or to `end` if there was none.
  TimeNs ResyncMax(BootTime end) const;

 private:
  void CountRejected(BootTime arrival);
  FrameName CountAccepted(BootTime arrival, const MessageReceiver::Frame& frame);
  void Audit(std::uint64_t payload_hash);

  bool faulty_;
  OnSentFrame on_sent_frame_;
  MessageReceiver receiver_;
  DirectionCounts counts_;
  std::int64_t wrong_count_ = 0, stale_count_ = 0;
  BootTime rejected_since_ns_ = BootTime::Never();
  TimeNs resync_max_ns_ = 0;

  // Numbers of the frames that carried a payload, ascending, by the payload's 64-bit FNV-1a.
  std::unordered_map<std::uint64_t, std::vector<std::int64_t>> sent_;
  std::int64_t next_number_ = 0;
  std::int64_t last_accepted_number_ = -1;
  MessageReceiver sent_receiver_;  // a sender may pause within a frame: its chunks are one stream
  std::array<std::vector<std::uint8_t>, 1024> recent_;  // frames as sent, by Chunk::number
};

}  // namespace tiltproof::harness
