// One direction of a serial line, byte-accurate: baud rate, character format, the sender's busy transmitter,
// faults, arrivals.
//
// The same code runs in lockstep (times are virtual) and in real time (times are the clock's): see
// link/time.h. Bytes travel as chunks with times. What is sent is cut into frames. Each complete
// frame goes through the filter as one chunk, and byte i of the chunk arrives at begin + (i + 1) byte times.
//
//   Wire wire({.baud = 921600}, Direction::kToPlant, protocol, filter);
//   BootTime sent = wire.Transmit(now, frame);        // when the last stop bit leaves the sender
//   BootTime next = wire.NextArrival();               // of the next byte worth waking for
//   wire.Take(next, [](BootTime arrival, std::span<const std::uint8_t> bytes) { ... });
//
// The protocol's framing knows where frames end (link/frame_cutter.h). Bytes of a frame that does not end go on as
// their own chunk once the sender has been silent for IdleTime(), or when there are kChunkBytesMax of them. Times do
// not depend on how the sent bytes are split over calls of Transmit(). A sender that pauses within a frame delays the
// whole frame, so that its last byte is on time.
//
// Nothing arrives before the wire could know of it: the result of the filter ends, at the earliest, when the
// frame's last byte was handed over (or the idle time was over).
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "link/chunk.h"
#include "link/protocol.h"

namespace tiltproof::link {

struct WireConfig {
  std::int64_t baud = 921'600;    // bits per second; 0 = ideal, zero byte time
  TimeNs adapter_latency_ns = 0;  // a USB-serial adapter's buffering: added to every arrival
  // The bytes that the buffer of an adapter has room for. It is passed on when it is full, and
  // adapter_latency_ns after its first byte. 0: there is no buffer.
  std::int64_t adapter_bytes_count = 0;
  // Nothing of what is given to the transmitter arrives sooner than this, whatever faults have removed before it.
  TimeNs least_latency_ns = 0;
  // With seven data bits a byte loses its top bit, wherever it comes from.
  CharacterFormat character = {};
};

class Wire {
 public:
  static constexpr std::int64_t kIdleBytes = 20;
  // More bytes than any frame of a protocol has.
  static constexpr std::size_t kChunkBytesMax = 1024;

  // `filter` may be null (no faults); it and the protocol must outlive the wire.
  Wire(const WireConfig& config, Direction direction, const Protocol& protocol, ChunkFilter* filter);

  // The sender puts bytes into its transmitter at `now` (not decreasing); they follow what it is still
  // sending. Returns when the last stop bit has left.
  BootTime Transmit(BootTime now, std::span<const std::uint8_t> bytes);

  // Bytes that travel here although the sender did not send them, as an echo does. They begin at `begin`, or when
  // what waits here before them has passed. The filter does not act on them. They carry the number of the last
  // frame that the sender sent.
  void Insert(BootTime begin, std::span<const std::uint8_t> bytes);

  // More was to wait here than kLineBytesMax. From then on nothing more is sent.
  bool overfull() const { return overfull_; }

  // When the sender's transmitter is free: all frames so far have begun and ended before.
  BootTime free_ns() const { return transmitter_free_ns_; }

  // Earliest time at which Take() has something for which its receiver should be woken: the end of a piece
  // (see TakePiece()), or the end of the idle time of a frame that does not end. Never() when the wire is
  // empty.
  BootTime NextArrival() const;

  struct Piece {
    BootTime arrival_ns;  // of the last byte
    std::span<const std::uint8_t> bytes;
    std::uint64_t number;  // Chunk::number of the frame, as sent, that they come from
    std::span<const std::uint8_t> parity_errors = {};  // Chunk::parity_errors of these bytes
  };
  // The oldest bytes that have arrived by `until` and were not taken yet: up to one that may end a frame, the end of
  // their chunk, or the last byte arrived by `until`; nullopt when there are none. The bytes stay valid until the next call.
  std::optional<Piece> TakePiece(BootTime until);

  // Takes all of them: calls receiver(BootTime arrival, std::span<const std::uint8_t> bytes) for each piece.
  // The receiver may transmit, also on this wire.
  template <class Receiver>
  void Take(BootTime until, Receiver&& receiver) {
    while (const std::optional<Piece> piece = TakePiece(until)) receiver(piece->arrival_ns, piece->bytes);
  }

  // Called with every chunk as sent, and with every chunk that goes on after the filter (for logs); with an
  // adapter's buffer also with what it passed on at once.
  struct Taps {
    std::function<void(const Chunk&)> sent;
    std::function<void(const Chunk&)> delivered;
    std::function<void(BootTime at, std::span<const std::uint8_t> bytes)> passed_on = nullptr;
  };
  void SetTaps(Taps taps) { taps_ = std::move(taps); }

  // Time from begin to the arrival of the n-th byte, rounded down to nanoseconds.
  TimeNs BytesTime(std::int64_t byte_count) const { return rate_.BytesTime(byte_count); }

  // Silence of the sender after which a frame that has not ended goes on: kIdleBytes byte times; on an ideal
  // line, byte times at 921600 baud.
  TimeNs IdleTime() const;

 private:
  // The number of bytes that belong to the open chunk; sets `closed` when the last of them closes it.
  std::size_t BytesOfOpenChunk(std::span<const std::uint8_t> bytes, bool& closed);
  // The place of the message of a frame as sent in the protocol's table; kNoMessage: it is none.
  std::uint8_t MessageIn(std::span<const std::uint8_t> frame);
  void FlushIfIdle(BootTime now);
  // The part of the bytes that characters carry; valid until the next call.
  std::span<const std::uint8_t> Carried(std::span<const std::uint8_t> bytes);
  // The open chunk goes through the filter, into the queue; the wire knows of all of it at `known_ns`.
  void SendOpenChunk(BootTime known_ns);
  // True if there is room for that many bytes; otherwise the wire is overfull.
  bool HasRoomFor(std::size_t bytes);
  void Enqueue(Chunk&& chunk, BootTime known_ns);
  void Recycle(Chunk&& chunk);
  // Index one past the next piece of the queue's front. Each byte that arrives is in the search for one piece.
  std::size_t FindPieceEnd();
  BootTime FrontArrival(std::size_t byte_count) const;
  // A byte that has come to the adapter's buffer.
  void Buffer(BootTime arrival);
  // The oldest bytes of the queue were taken: these.
  void LeaveBuffer(std::span<const std::uint8_t> bytes);

  WireConfig config_;
  LineRate rate_;
  Direction direction_;
  const Protocol* protocol_;
  ChunkFilter* filter_;
  Taps taps_;

  // The transmitter has been busy without a pause since busy_begin_ns_, and has sent everything at
  // transmitter_free_ns_.
  BootTime busy_begin_ns_ = BootTime::Earliest();
  std::int64_t busy_bytes_ = 0;
  BootTime transmitter_free_ns_ = BootTime::Earliest();

  std::uint64_t next_number_ = 0;                // of the open chunk
  Chunk open_;                                   // sent bytes of a frame that has not ended yet
  BootTime open_end_ns_ = BootTime::Earliest();  // when the last of them has left
  std::unique_ptr<FrameCutter> sent_cutter_;
  std::unique_ptr<FrameReader> sent_reader_;  // of single frames

  std::deque<Chunk> queue_;
  std::size_t queue_bytes_ = 0;  // total weight (WeightOf())
  bool overfull_ = false;
  BootTime queue_end_ns_ = BootTime::Earliest();     // end of the last chunk that went in
  std::size_t front_taken_ = 0;                      // bytes of queue_.front() already taken
  std::size_t piece_end_ = 0;                        // FindPieceEnd(), when the queue is not empty
  BootTime last_arrival_ns_ = BootTime::Earliest();  // of what was taken
  std::unique_ptr<FrameCutter> arrived_cutter_;      // of the bytes up to piece_end_
  Chunk taken_;                                      // keeps the last piece's bytes alive

  // Runs of bytes that the adapter's buffer passes on at once, of those in the queue that were not taken, in their
  // order. The last one is still being filled while buffered_count_ is not 0.
  struct PassedOn {
    BootTime at;
    std::size_t bytes;
  };
  std::deque<PassedOn> passed_on_;
  BootTime buffer_end_ns_ = BootTime::Earliest();
  std::int64_t buffered_count_ = 0;

  std::vector<Chunk> scratch_;
  std::vector<std::uint8_t> carried_;
  std::vector<std::vector<std::uint8_t>> spare_;  // buffers to use again
};

}  // namespace tiltproof::link
