// The end of one direction of the line: decodes what arrives, checks the messages, and audits it against what
// was sent.
//
// It is a shadow of the real receiver (the server, the client) with all checks of the protocol, so that the
// counters measure the protocol and not one firmware.
//
// The audit numbers the frames as sent. An accepted payload is
//   wrong  when it equals no payload sent so far in this direction: corruption that every check let through;
//   stale  when it equals only payloads sent at or before the last one accepted: a repeat, or older than what
//   came already.
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

#include "harness/run/run_log.h"
#include "link/chunk.h"
#include "link/frame.h"
#include "link/wire.h"

namespace tiltproof::harness {

// Frames with the number of the chunk (link::Chunk::number) that brought their content's last byte. The flag that closes
// a frame may belong to the next one.
class NumberedDecoder {
 public:
  // Calls on_event(const link::FrameEvent&, std::uint64_t number) for each frame that ends in `bytes`, all of one chunk.
  template <class OnEvent>
  void Decode(std::uint64_t number, std::span<const std::uint8_t> bytes, const OnEvent& on_event) {
    const auto is_content = [](std::uint8_t byte) { return byte != link::kFlag; };
    const auto content = std::find_if(bytes.begin(), bytes.end(), is_content);
    const auto flag_count = static_cast<std::size_t>(content - bytes.begin());
    DecodeNext(bytes.first(flag_count), on_event);
    if (content == bytes.end()) return;
    number_ = number;
    DecodeNext(bytes.subspan(flag_count), on_event);
  }

 private:
  template <class OnEvent>
  void DecodeNext(std::span<const std::uint8_t> bytes, const OnEvent& on_event) {
    while (const auto event = decoder_.Next(bytes)) on_event(*event, number_);
  }

  link::FrameDecoder decoder_;
  std::uint64_t number_ = 0;
};

class ReceivingEnd {
 public:
  // `faulty`: something stands in this direction that may edit bytes; without it nothing accepted can be
  // wrong, and the audit rests.
  ReceivingEnd(link::Direction direction, link::Dialect dialect, bool faulty);

  // Called with the payload of every frame as sent and its number (see NumberedDecoder).
  using OnSentPayload = std::function<void(std::uint64_t number, std::span<const std::uint8_t> payload)>;
  void SetOnSentPayload(OnSentPayload on_sent_payload) { on_sent_payload_ = std::move(on_sent_payload); }

  // Taps of the wire.
  void OnSent(const link::Chunk& chunk);
  void OnDelivered(const link::Chunk& chunk);

  using OnAccepted =
      std::function<void(TimeNs arrival, std::uint64_t number, std::span<const std::uint8_t> payload)>;
  // `reason` is a Name() of link::FrameStatus or link::MessageStatus.
  using OnRejected = std::function<void(TimeNs arrival, std::string_view reason)>;
  // Bytes that have arrived.
  void Receive(const link::Wire::Piece& piece, const OnAccepted& on_accepted, const OnRejected& on_rejected);

  const DirectionCounts& counts() const { return counts_; }
  std::int64_t wrong_count() const { return wrong_count_; }
  std::int64_t stale_count() const { return stale_count_; }
  // Longest time from a rejection to the next accepted frame, or to `end` if none came.
  TimeNs ResyncMax(TimeNs end) const;

 private:
  link::MessageStatus Check(std::span<const std::uint8_t> payload) const;
  void AuditAccepted(std::span<const std::uint8_t> payload);

  link::Direction direction_;
  link::Dialect dialect_;
  bool faulty_;
  OnSentPayload on_sent_payload_;
  NumberedDecoder decoder_;
  DirectionCounts counts_;
  std::int64_t wrong_count_ = 0, stale_count_ = 0;
  TimeNs rejected_since_ns_ = kNever;
  TimeNs resync_max_ns_ = 0;

  // Numbers of the frames that carried a payload, ascending, by the payload's 64-bit FNV-1a.
  std::unordered_map<std::uint64_t, std::vector<std::int64_t>> sent_;
  std::int64_t next_number_ = 0;
  std::int64_t last_accepted_number_ = -1;
  NumberedDecoder sent_decoder_;  // a sender may pause within a frame: its chunks are one stream
  std::array<std::vector<std::uint8_t>, 1024> recent_;  // frames as sent, by Chunk::number
};

}  // namespace tiltproof::harness
