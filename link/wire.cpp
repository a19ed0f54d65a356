#include "link/wire.h"

#include <algorithm>

#include "link/check.h"

namespace tiltproof::link {
namespace {

constexpr std::size_t kSpareBuffersMax = 16;
constexpr std::size_t kUsualFrameBytes = 134;  // 64 of payload, all escaped

}  // namespace

Wire::Wire(const WireConfig& config, Direction direction, const Protocol& protocol, ChunkFilter* filter)
    : config_(config),
      rate_{config.baud, config.character},
      direction_(direction),
      protocol_(&protocol),
      filter_(filter),
      sent_cutter_(protocol.framing->MakeCutter()),
      sent_reader_(protocol.framing->MakeReader()),
      arrived_cutter_(protocol.framing->MakeCutter()) {}

std::uint8_t Wire::MessageIn(std::span<const std::uint8_t> frame) {
  Check(!frame.empty(), "a chunk as sent has bytes");
  sent_reader_->Finish();
  // The frame's opening may be the end of the frame before.
  std::span<const std::uint8_t> opening = protocol_->framing->opening();
  if (!opening.empty() && frame.front() != opening.front()) sent_reader_->Next(opening);
  while (const auto read = sent_reader_->Next(frame)) {
    if (!read->ok) continue;
    const MessageType* type = protocol_->Classify(direction_, read->payload);
    return type == nullptr ? kNoMessage : static_cast<std::uint8_t>(type - protocol_->messages.data());
  }
  return kNoMessage;
}

TimeNs Wire::IdleTime() const { return rate_.OrUsual().BytesTime(kIdleBytes); }

std::span<const std::uint8_t> Wire::Carried(std::span<const std::uint8_t> bytes) {
  const CharacterFormat& character = config_.character;
  if (character.data_bits == 8) return bytes;
  carried_.clear();
  for (const std::uint8_t byte : bytes) carried_.push_back(character.Carried(byte));
  return carried_;
}

BootTime Wire::Transmit(BootTime now, std::span<const std::uint8_t> bytes) {
  FlushIfIdle(now);
  bytes = Carried(bytes);
  if (overfull_) return std::max(now, transmitter_free_ns_);
  if (now > transmitter_free_ns_) {
    if (bytes.empty()) return now;
    busy_begin_ns_ = now;
    busy_bytes_ = 0;
    transmitter_free_ns_ = now;
  }
  while (!bytes.empty()) {
    const BootTime begin = transmitter_free_ns_;
    bool closed = false;
    const std::size_t size = BytesOfOpenChunk(bytes, closed);
    busy_bytes_ += static_cast<std::int64_t>(size);
    transmitter_free_ns_ = busy_begin_ns_ + BytesTime(busy_bytes_);
    // `baud` bytes take whole seconds exactly: the count stays small however long the line is busy.
    if (config_.baud != 0 && busy_bytes_ >= config_.baud) {
      busy_begin_ns_ += config_.character.bit_count() * kNsPerS;
      busy_bytes_ -= config_.baud;
    }

    if (open_.bytes.empty()) {
      open_.begin_ns = begin;
    } else {
      open_.begin_ns += begin - open_end_ns_;
    }
    open_.bytes.insert(open_.bytes.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    open_end_ns_ = transmitter_free_ns_;
    if (closed) SendOpenChunk(now + config_.least_latency_ns);
    bytes = bytes.subspan(size);
  }
  return transmitter_free_ns_;
}

std::size_t Wire::BytesOfOpenChunk(std::span<const std::uint8_t> bytes, bool& closed) {
  Check(open_.bytes.size() <= kChunkBytesMax, "an open chunk is no larger than a chunk may be");
  const std::size_t room = kChunkBytesMax - open_.bytes.size();
  if (bytes.size() > room) bytes = bytes.first(room);
  const std::optional<std::size_t> end = sent_cutter_->FindEnd(bytes);
  closed = end || bytes.size() == room;
  return end.value_or(bytes.size());
}

void Wire::FlushIfIdle(BootTime now) {
  if (open_.bytes.empty()) return;
  const BootTime flush = open_end_ns_ + IdleTime();
  if (now >= flush) SendOpenChunk(flush);
}

void Wire::SendOpenChunk(BootTime known_ns) {
  Chunk chunk = std::move(open_);
  chunk.number = next_number_++;
  open_ = Chunk{};
  if (!spare_.empty()) {
    open_.bytes = std::move(spare_.back());
    spare_.pop_back();
  } else {
    open_.bytes.reserve(kUsualFrameBytes);
  }
  sent_cutter_->Reset();

  if (filter_ == nullptr) {
    if (taps_.sent) taps_.sent(chunk);
    if (HasRoomFor(WeightOf(chunk))) Enqueue(std::move(chunk), known_ns);
    return;
  }
  chunk.message = MessageIn(chunk.bytes);
  if (taps_.sent) taps_.sent(chunk);
  scratch_.clear();
  scratch_.push_back(std::move(chunk));
  filter_->Apply(scratch_);
  std::size_t bytes = filter_->held_bytes();
  for (const Chunk& after : scratch_) bytes += WeightOf(after);
  if (!HasRoomFor(bytes)) {
    scratch_ = {};
    return;
  }
  for (Chunk& after : scratch_) Enqueue(std::move(after), known_ns);
}

void Wire::Insert(BootTime begin, std::span<const std::uint8_t> bytes) {
  Chunk chunk{.begin_ns = begin,
              .bytes = {bytes.begin(), bytes.end()},
              .number = next_number_ == 0 ? 0 : next_number_ - 1};
  const std::size_t held_bytes = filter_ == nullptr ? 0 : filter_->held_bytes();
  if (!HasRoomFor(held_bytes + WeightOf(chunk))) return;
  const TimeNs duration = BytesTime(static_cast<std::int64_t>(bytes.size()));
  Enqueue(std::move(chunk), begin + duration);
}

bool Wire::HasRoomFor(std::size_t bytes) {
  overfull_ = overfull_ || queue_bytes_ + bytes > kLineBytesMax;
  return !overfull_;
}

void Wire::Enqueue(Chunk&& chunk, BootTime known_ns) {
  Check(chunk.parity_errors.empty() || chunk.parity_errors.size() == chunk.bytes.size(),
        "a chunk knows the parity of each of its bytes");
  if (config_.character.data_bits != 8)  // a fault may have put other bytes there
    for (std::uint8_t& byte : chunk.bytes) byte = config_.character.Carried(byte);
  if (chunk.bytes.empty()) {
    Recycle(std::move(chunk));
    return;
  }
  const TimeNs duration = BytesTime(static_cast<std::int64_t>(chunk.bytes.size()));
  chunk.begin_ns = std::max({chunk.begin_ns, queue_end_ns_, known_ns - duration});
  queue_end_ns_ = chunk.begin_ns + duration;
  if (taps_.delivered) taps_.delivered(chunk);
  if (config_.adapter_bytes_count > 0)
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i)
      Buffer(chunk.begin_ns + BytesTime(static_cast<std::int64_t>(i) + 1));
  queue_bytes_ += WeightOf(chunk);
  Check(queue_bytes_ <= kLineBytesMax, "no more waits on a wire than it has room for");
  queue_.push_back(std::move(chunk));
  if (queue_.size() == 1) piece_end_ = FindPieceEnd();
}

void Wire::Recycle(Chunk&& chunk) {
  const std::size_t capacity = chunk.bytes.capacity();
  if (spare_.size() >= kSpareBuffersMax || capacity == 0 || capacity > kChunkBytesMax) return;
  chunk.bytes.clear();
  spare_.push_back(std::move(chunk.bytes));
}

std::size_t Wire::FindPieceEnd() {
  Check(!queue_.empty() && front_taken_ < queue_.front().bytes.size(),
        "a piece is looked for where bytes are left");
  const auto bytes = std::span<const std::uint8_t>(queue_.front().bytes).subspan(front_taken_);
  return front_taken_ + arrived_cutter_->FindEnd(bytes).value_or(bytes.size());
}

BootTime Wire::FrontArrival(std::size_t byte_count) const {
  if (config_.adapter_bytes_count == 0)
    return queue_.front().begin_ns + BytesTime(static_cast<std::int64_t>(byte_count)) +
           config_.adapter_latency_ns;
  Check(byte_count >= front_taken_, "a piece ends after what was taken");
  std::size_t left = byte_count - front_taken_;
  for (const PassedOn& part : passed_on_) {
    if (left <= part.bytes) return part.at;
    left -= part.bytes;
  }
  ThrowBrokenInvariant("an adapter knows when it passes on each byte that waits in it");
}

void Wire::Buffer(BootTime arrival) {
  if (buffered_count_ == 0 || arrival > buffer_end_ns_) {
    buffer_end_ns_ = arrival + config_.adapter_latency_ns;
    buffered_count_ = 0;
    passed_on_.push_back({std::max(buffer_end_ns_, last_arrival_ns_), 0});
  }
  ++passed_on_.back().bytes;
  if (++buffered_count_ < config_.adapter_bytes_count) return;
  // A chunk may be known only after some of its bytes have come: nothing is passed on before what was.
  passed_on_.back().at = std::max(arrival, last_arrival_ns_);
  buffered_count_ = 0;
}

void Wire::LeaveBuffer(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    Check(!passed_on_.empty(), "bytes that leave an adapter were in its buffer");
    PassedOn& oldest = passed_on_.front();
    const auto now = bytes.first(std::min(oldest.bytes, bytes.size()));
    if (taps_.passed_on) taps_.passed_on(oldest.at, now);
    oldest.bytes -= now.size();
    bytes = bytes.subspan(now.size());
    if (oldest.bytes == 0) passed_on_.pop_front();
  }
  if (passed_on_.empty()) buffered_count_ = 0;
}

BootTime Wire::NextArrival() const {
  BootTime next = BootTime::Never();
  if (!queue_.empty()) next = FrontArrival(piece_end_);
  if (!open_.bytes.empty()) next = std::min(next, open_end_ns_ + IdleTime() + config_.adapter_latency_ns);
  return next;
}

std::optional<Wire::Piece> Wire::TakePiece(BootTime until) {
  FlushIfIdle(until);
  if (queue_.empty()) return std::nullopt;

  std::size_t end = piece_end_;
  BootTime arrival = FrontArrival(end);
  if (arrival > until) {
    // Few pieces are taken before they are whole: count on from what was taken.
    end = front_taken_;
    while (FrontArrival(end + 1) <= until) ++end;
    if (end == front_taken_) return std::nullopt;
    arrival = FrontArrival(end);
  }

  Chunk& front = queue_.front();
  Check(front_taken_ < end && end <= front.bytes.size(), "a piece is a part of the oldest chunk");
  Check(last_arrival_ns_ <= arrival && arrival <= until,
        "bytes arrive in order of time, none before its time");
  last_arrival_ns_ = arrival;
  Piece piece{arrival, std::span(front.bytes).subspan(front_taken_, end - front_taken_), front.number};
  if (!front.parity_errors.empty())
    piece.parity_errors = std::span(front.parity_errors).subspan(front_taken_, end - front_taken_);
  if (config_.adapter_bytes_count > 0) LeaveBuffer(piece.bytes);
  front_taken_ = end;
  if (front_taken_ == front.bytes.size()) {
    Check(WeightOf(front) <= queue_bytes_, "what waits on a wire was counted in");
    queue_bytes_ -= WeightOf(front);
    Recycle(std::move(taken_));
    taken_ = std::move(front);
    queue_.pop_front();
    front_taken_ = 0;
    if (!queue_.empty()) piece_end_ = FindPieceEnd();
  } else if (front_taken_ == piece_end_) {
    piece_end_ = FindPieceEnd();
  }
  return piece;
}

}  // namespace tiltproof::link
