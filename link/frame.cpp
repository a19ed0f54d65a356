#include "link/frame.h"

#include <limits>

#include "link/crc32.h"
#include "link/fletcher16.h"

namespace tiltproof::link {
namespace {

// "..."sv knows its length; a plain literal needs strlen() where nothing is optimised.
using namespace std::string_view_literals;

// A frame is so short that the sums need no modulo before its end: of n bytes FF, sum1 is 255 n and sum2 255
// n (n + 1) / 2.
constexpr std::uint64_t kUncheckedBytesMax = kPayloadBytesMax + CheckBytes(FrameCheck::kCrc32);
static_assert(255 * kUncheckedBytesMax * (kUncheckedBytesMax + 1) / 2 <=
              std::numeric_limits<std::uint32_t>::max());

// 0x7D and 0x7E are neighbours: one comparison finds both.
static_assert(kFlag == kEscape + 1);
constexpr bool MustEscape(std::uint8_t byte) { return static_cast<std::uint8_t>(byte - kEscape) <= 1; }

// The same for four bytes at once: in 7 bits, which leave room for the carry, escape and flag are 0x80 with 3
// added, and the byte after them is so with 1 added.
bool AnyMustEscape(const std::uint8_t* four) {
  const std::uint32_t word = static_cast<std::uint32_t>(four[0]) | static_cast<std::uint32_t>(four[1]) << 8 |
                             static_cast<std::uint32_t>(four[2]) << 16 |
                             static_cast<std::uint32_t>(four[3]) << 24;  // one load
  const std::uint32_t low = word & 0x7F7F'7F7F;
  return ((low + 0x0303'0303) & ~(low + 0x0101'0101) & ~word & 0x8080'8080) != 0;
}

constexpr std::uint8_t Low(std::uint32_t sum) { return static_cast<std::uint8_t>(sum % kFletcherModulus); }

// Writes the byte, escaped if need be, and returns where the next one goes.
std::uint8_t* PutEscaped(std::uint8_t* out, std::uint8_t byte) {
  if (MustEscape(byte)) {
    *out++ = kEscape;
    byte ^= kEscapeXor;
  }
  *out++ = byte;
  return out;
}

constexpr std::uint8_t ByteOf(std::uint32_t check, std::size_t i) {
  return static_cast<std::uint8_t>(check >> 8 * i & 0xFF);
}

// Exact length of the payload's frame on the wire.
std::size_t FrameBytes(std::span<const std::uint8_t> payload, FrameCheck kind) {
  const std::uint32_t check = kind == FrameCheck::kFletcher16 ? Fletcher16(payload) : Crc32(payload);
  std::size_t count = 2 + payload.size() + CheckBytes(kind);
  for (const std::uint8_t byte : payload) count += MustEscape(byte);
  for (std::size_t i = 0; i < CheckBytes(kind); ++i) count += MustEscape(ByteOf(check, i));
  return count;
}

}  // namespace

std::string_view Name(FrameStatus status) {
  switch (status) {
    case FrameStatus::kOk:
      return "ok"sv;
    case FrameStatus::kBadChecksum:
      return "bad_checksum"sv;
    case FrameStatus::kTooShort:
      return "too_short"sv;
    case FrameStatus::kTooLong:
      return "too_long"sv;
    case FrameStatus::kDanglingEscape:
      return "dangling_escape"sv;
    case FrameStatus::kEmpty:
      return "empty"sv;
    case FrameStatus::kAborted:
      return "aborted"sv;
    case FrameStatus::kNoOpeningFlag:
      return "no_opening_flag"sv;
  }
  return "unknown"sv;
}

std::optional<FrameEvent> FrameDecoder::Next(std::span<const std::uint8_t>& bytes) {
  if (state_ == State::kHunting || state_ == State::kSkipping) {
    if (auto event = SeekFlag(bytes)) return event;
    if (bytes.empty()) return std::nullopt;
  }
  return ReadFrame(bytes);
}

std::optional<FrameEvent> FrameDecoder::Finish() {
  std::optional<FrameEvent> event;
  if (state_ == State::kEscaped || (state_ == State::kInFrame && size_ > 0)) {
    event = MakeEvent(FrameStatus::kAborted, size_);
  } else if (state_ == State::kHunting && begin_ != offset_) {
    event = MakeEvent(FrameStatus::kNoOpeningFlag, 0);
  }
  state_ = State::kHunting;
  begin_ = offset_;
  return event;
}

std::optional<FrameEvent> FrameDecoder::SeekFlag(std::span<const std::uint8_t>& bytes) {
  std::size_t count = 0;
  while (count < bytes.size() && bytes[count] != kFlag) ++count;
  const bool found = count < bytes.size();
  const bool garbage = state_ == State::kHunting && offset_ + count != begin_;
  if (found) ++count;
  offset_ += count;
  bytes = bytes.subspan(count);
  if (!found) return std::nullopt;
  std::optional<FrameEvent> event;
  if (garbage) event = MakeEvent(FrameStatus::kNoOpeningFlag, 0);
  OpenFrame();
  return event;
}

std::optional<FrameEvent> FrameDecoder::ReadFrame(std::span<const std::uint8_t>& bytes) {
  const std::uint8_t* const first = bytes.data();
  const std::uint8_t* const last = first + bytes.size();
  const std::uint8_t* in = first;
  std::uint8_t* out = buffer_.data() + size_;
  std::uint8_t* const out_end = buffer_.data() + kPayloadBytesMax + CheckBytes(check_);
  std::uint32_t sum1 = sum1_;
  std::uint32_t sum2 = sum2_;
  bool escaped = state_ == State::kEscaped;

  // Every way out goes through here, so that the loops below work on locals alone.
  const auto leave = [&](State state) {
    const auto consumed = static_cast<std::size_t>(in - first);
    offset_ += consumed;
    bytes = bytes.subspan(consumed);
    size_ = static_cast<std::size_t>(out - buffer_.data());
    sum1_ = sum1;
    sum2_ = sum2;
    state_ = state;
  };

  const auto append = [&](std::uint8_t byte) {
    *out++ = byte;
    sum1 += byte;
    sum2 += sum1;
  };

  while (in != last) {
    std::uint8_t byte = *in;
    if (!escaped) {
      if (!MustEscape(byte)) {
        // Plain bytes: one bound for the end of the input and of the buffer.
        const std::uint8_t* const plain_end = last - in < out_end - out ? last : in + (out_end - out);
        for (; plain_end - in >= 4 && !AnyMustEscape(in); in += 4) {
          append(in[0]);
          append(in[1]);
          append(in[2]);
          append(in[3]);
        }
        for (; in != plain_end && !MustEscape(*in); ++in) append(*in);
        if (in == last) break;
        byte = *in;
      }
      if (byte == kEscape) {
        escaped = true;
        if (++in == last) break;
        byte = *in;
      }
    }
    ++in;
    if (byte == kFlag) {
      if (!escaped && out == buffer_.data()) {  // idle: this flag opens the frame
        begin_ = offset_ + static_cast<std::size_t>(in - first) - 1;
        continue;
      }
      leave(State::kInFrame);
      return CloseFrame(escaped ? FrameStatus::kDanglingEscape : Judge());
    }
    if (out == out_end) {
      leave(State::kSkipping);
      return MakeEvent(FrameStatus::kTooLong, size_);
    }
    // Plain bytes end at a flag, an escape or a full buffer: this one was escaped.
    append(byte ^ kEscapeXor);
    escaped = false;
  }
  leave(escaped ? State::kEscaped : State::kInFrame);
  return std::nullopt;
}

FrameStatus FrameDecoder::Judge() const {
  if (size_ < CheckBytes(check_)) return FrameStatus::kTooShort;
  if (!CheckHolds()) return FrameStatus::kBadChecksum;
  return size_ == CheckBytes(check_) ? FrameStatus::kEmpty : FrameStatus::kOk;
}

bool FrameDecoder::CheckHolds() const {
  if (check_ == FrameCheck::kCrc32) {
    const std::span<const std::uint8_t> content(buffer_.data(), size_);
    const std::uint32_t check = Crc32(content.first(size_ - CheckBytes(check_)));
    for (std::size_t i = 0; i < CheckBytes(check_); ++i)
      if (content[size_ - CheckBytes(check_) + i] != ByteOf(check, i)) return false;
    return true;
  }
  // The sums run over the check too, because it is not known to be one before the flag; take its two bytes
  // out again.
  const std::uint8_t check1 = buffer_[size_ - 2];
  const std::uint8_t check2 = buffer_[size_ - 1];
  const std::uint32_t sum1 = sum1_ - check2 - check1;
  const std::uint32_t sum2 = sum2_ - sum1_ - (sum1_ - check2);
  return Low(sum1) == check1 && Low(sum2) == check2;
}

FrameEvent FrameDecoder::CloseFrame(FrameStatus status) {
  const bool has_check =
      status == FrameStatus::kOk || status == FrameStatus::kEmpty || status == FrameStatus::kBadChecksum;
  const FrameEvent event = MakeEvent(status, has_check ? size_ - CheckBytes(check_) : size_);
  OpenFrame();
  return event;
}

FrameEvent FrameDecoder::MakeEvent(FrameStatus status, std::size_t payload_bytes) {
  ++counts_[static_cast<std::size_t>(status)];
  const std::size_t shown = payload_bytes < kPayloadBytesMax ? payload_bytes : kPayloadBytesMax;
  return {status, {buffer_.data(), shown}, begin_, offset_};
}

void FrameDecoder::OpenFrame() {
  state_ = State::kInFrame;
  size_ = 0;
  sum1_ = 0;
  sum2_ = 0;
  begin_ = offset_ - 1;
}

EncodedFrame EncodeFrame(std::span<const std::uint8_t> payload, std::span<std::uint8_t> wire,
                         FrameCheck kind) {
  if (payload.size() > kPayloadBytesMax) return {};
  // Room for the worst case needs no counting of escapes.
  if (wire.size() < FrameBytesMax(payload.size(), kind) && wire.size() < FrameBytes(payload, kind)) return {};
  std::uint8_t* out = wire.data();
  std::uint32_t sum1 = 0;
  std::uint32_t sum2 = 0;
  *out++ = kFlag;
  for (const std::uint8_t byte : payload) {
    sum1 += byte;
    sum2 += sum1;
    out = PutEscaped(out, byte);
  }
  const std::uint32_t check =
      kind == FrameCheck::kFletcher16 ? std::uint32_t{Low(sum2)} << 8 | Low(sum1) : Crc32(payload);
  for (std::size_t i = 0; i < CheckBytes(kind); ++i) out = PutEscaped(out, ByteOf(check, i));
  *out++ = kFlag;
  return {{wire.data(), static_cast<std::size_t>(out - wire.data())}};
}

}  // namespace tiltproof::link
