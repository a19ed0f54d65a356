// One direction of a serial line, byte-accurate: baud rate, 8N1 byte time, the sender's busy transmitter, fault stages, arrivals.
//
// The same code runs in lockstep (times are virtual) and in real time (times are the clock's). Bytes travel as chunks with times:
// what is sent is cut into frames at the flags, each frame goes through the stage as one chunk when it is complete, and byte i of
// the chunk arrives at begin + (i + 1) byte times. Bytes that no flag closes go on as a chunk of their own once the line has been
// idle for kIdleBytes byte times.
//
//   Wire wire({.baud = 921600}, Direction::kToPlant, Dialect::kPaper, stage);
//   TimeNs sent = wire.Transmit(now, frame);          // when the last stop bit leaves the sender
//   TimeNs next = wire.NextArrival();                 // of the next byte worth waking for: a flag, or a chunk's last byte
//   wire.Take(next, [](TimeNs arrival, std::span<const std::uint8_t> bytes) { ... });
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include "link/chunk.h"

namespace tiltproof::link {

struct WireConfig {
  std::int64_t baud = 921'600;    // bits per second, 8N1: ten bits a byte; 0 = ideal, zero byte time
  TimeNs adapter_latency_ns = 0;  // a USB-serial adapter's buffering: added to every arrival
};

class Wire {
 public:
  static constexpr std::int64_t kIdleBytes = 20;

  // `stage` may be null (no faults) and must outlive the wire.
  Wire(const WireConfig& config, Direction direction, Dialect dialect, ChunkStage* stage);

  // The sender puts bytes in its transmitter at `now` (not decreasing); they follow what it is still sending. Returns when the last
  // stop bit has left.
  TimeNs Transmit(TimeNs now, std::span<const std::uint8_t> bytes);

  // Earliest time at which Take() has something that its receiver should be woken for: the arrival of a flag or of a chunk's last
  // byte, or the end of the idle time of bytes that no flag closed. kNever when the wire is empty.
  TimeNs NextArrival() const;

  // Delivers every byte that has arrived by `until`, oldest first, in pieces: a piece ends at a flag, at its chunk's end, or at the
  // last byte arrived by `until`; `arrival` is that of the piece's last byte.
  using Receiver = std::function<void(TimeNs arrival, std::span<const std::uint8_t> bytes)>;
  void Take(TimeNs until, const Receiver& receiver);

  // Called with every chunk as sent, and with every chunk that goes on after the stages (for logs).
  struct Taps {
    std::function<void(const Chunk&)> sent;
    std::function<void(const Chunk&)> delivered;
  };
  void SetTaps(Taps taps) { taps_ = std::move(taps); }

  // Time from begin to the arrival of the n-th byte, rounded down to nanoseconds.
  TimeNs BytesTime(std::int64_t byte_count) const {
    return config_.baud == 0 ? 0 : byte_count * 10 * kNsPerS / config_.baud;
  }

 private:
  void SendChunk(Chunk chunk);  // through the stage, into the queue

  WireConfig config_;
  Direction direction_;
  Dialect dialect_;
  ChunkStage* stage_;
  Taps taps_;
  TimeNs transmitter_free_ns_ = kPowerOn;  // when the sender's transmitter has sent all it was given
  Chunk open_;                             // sent bytes that no flag has closed yet
  TimeNs queue_end_ns_ = kPowerOn;         // end of the last chunk in the queue
  std::deque<Chunk> queue_;
  std::size_t front_taken_ = 0;  // bytes of queue_.front() already delivered
  std::vector<Chunk> scratch_;
};

}  // namespace tiltproof::link
