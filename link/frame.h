// The low-level protocol (paper, section 2.1, Figure 2): 0x7E | escaped(payload, check_lo, check_hi) | 0x7E.
//
// An adaptation of PPP's framing (RFC 1662): 0x7E and 0x7D inside are sent as 0x7D, byte ^ 0x20; the check is
// Fletcher-16 over the unescaped payload, low byte first, or CRC-32/ISO-HDLC in its four bytes. Freestanding: no heap,
// no exceptions, nothing but fixed buffers; the firmware runs exactly this code.
//
//   std::array<std::uint8_t, FrameBytesMax(64)> wire;
//   EncodedFrame frame = EncodeFrame(payload, wire);          // frame.bytes is the part of `wire` in use
//
//   FrameDecoder decoder;
//   while (auto event = decoder.Next(received)) {             // consumes `received` from its front
//     if (event->status == FrameStatus::kOk) Use(event->payload);
//   }
//
// The decoder accepts shared flags (one 0x7E closes a frame and opens the next) and separate ones, and finds
// its way again at the next flag after anything. The same bytes give the same events, offsets included, in
// any chunks.
//
// After an escape any byte but a flag is taken and undone by ^ 0x20, not only 5E and 5D: as in RFC 1662
// (section 4.2), a receiver must cope with a sender that escapes more than it has to, and damage is for the
// checksum to find.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "link/message_kind.h"

namespace tiltproof::link {

inline constexpr std::uint8_t kFlag = 0x7E;
inline constexpr std::uint8_t kEscape = 0x7D;
inline constexpr std::uint8_t kEscapeXor = 0x20;

// The check behind the payload.
enum class FrameCheck : std::uint8_t { kFletcher16, kCrc32 };
constexpr std::size_t CheckBytes(FrameCheck check) { return check == FrameCheck::kFletcher16 ? 2 : 4; }

// Longest frame on the wire for a payload of that many bytes: everything escaped.
constexpr std::size_t FrameBytesMax(std::size_t payload_bytes, FrameCheck check = FrameCheck::kFletcher16) {
  return 2 * (payload_bytes + CheckBytes(check)) + 2;
}

enum class FrameStatus : std::uint8_t {
  kOk,
  kBadChecksum,  // whole frame, the check differs
  kTooShort,     // fewer bytes between two flags than a check has
  kTooLong,  // more than kPayloadBytesMax bytes and the check, unescaped; reported at the byte too many, then silent up
             // to the next flag
  kDanglingEscape,  // an escape directly before the closing flag (RFC 1662's abort)
  kEmpty,           // check right, no payload: no message is empty
  kAborted,         // Finish() while a frame was open: the stream ended or its receiver flushed it
  kNoOpeningFlag,   // bytes before the first flag ever seen (or since Finish()); reported when that flag
                    // comes, or at Finish()
};
inline constexpr std::size_t kFrameStatusCount = 8;

// "ok", "bad_checksum", ...: the names in `tiltproof frame decode`.
std::string_view Name(FrameStatus status);

struct FrameEvent {
  FrameStatus status;
  // The unescaped payload for kOk, kEmpty and kBadChecksum (check removed); otherwise what had been unescaped
  // so far, check bytes included, at most the first kPayloadBytesMax; nothing for kNoOpeningFlag. Points into
  // the decoder: valid until its next call.
  std::span<const std::uint8_t> payload;
  // Offset in the stream, in bytes since construction, of the frame's opening flag (of its first byte if it
  // has none), and one past the byte at which the event came: the closing flag, the byte too many, or the
  // last byte before Finish(). A closing flag may be the next event's opening flag too.
  std::uint64_t begin;
  std::uint64_t end;
};

class FrameDecoder {
 public:
  explicit FrameDecoder(FrameCheck check = FrameCheck::kFletcher16) : check_(check) {}

  // Consumes bytes from the front of `bytes` up to the end of the next frame or rejection and returns it;
  // nullopt when all of `bytes` is consumed and none has ended. Two flags with nothing between them are idle
  // line, not an event.
  std::optional<FrameEvent> Next(std::span<const std::uint8_t>& bytes);

  // The stream has ended, or its receiver drops what it holds: an open frame with bytes in it becomes
  // kAborted, bytes without a flag become kNoOpeningFlag, and the decoder waits for a flag again. Offsets go
  // on counting.
  std::optional<FrameEvent> Finish();

  // The number of times that each status was returned, indexed by FrameStatus; modulo 2^32.
  const std::array<std::uint32_t, kFrameStatusCount>& Counts() const { return counts_; }

 private:
  enum class State : std::uint8_t { kHunting, kInFrame, kEscaped, kSkipping };

  // kHunting and kSkipping: consumes bytes through the next flag.
  std::optional<FrameEvent> SeekFlag(std::span<const std::uint8_t>& bytes);
  // kInFrame and kEscaped: consumes bytes to the end of a frame that is an event.
  std::optional<FrameEvent> ReadFrame(std::span<const std::uint8_t>& bytes);
  // The status of the size_ bytes between two flags; size_ > 0.
  FrameStatus Judge() const;
  // True if the last CheckBytes(check_) of them are the check of those before.
  bool CheckHolds() const;
  // The event of the frame that the flag before offset_ closes; the flag opens the next one.
  FrameEvent CloseFrame(FrameStatus status);
  // An event that ends before offset_, counted.
  FrameEvent MakeEvent(FrameStatus status, std::size_t payload_bytes);
  // The flag before offset_ opens a frame.
  void OpenFrame();

  // kPayloadBytesMax and the longest check, unescaped; size_ in use. Left uninitialised on purpose: only what was
  // written is read.
  std::array<std::uint8_t, kPayloadBytesMax + CheckBytes(FrameCheck::kCrc32)> buffer_;
  std::size_t size_ = 0;
  // Fletcher's sums of the bytes in buffer_, not reduced: they cannot overflow (frame.cpp).
  std::uint32_t sum1_ = 0;
  std::uint32_t sum2_ = 0;
  FrameCheck check_;
  State state_ = State::kHunting;
  std::uint64_t offset_ = 0;  // of the next byte
  std::uint64_t begin_ = 0;   // of the open frame's opening flag; hunting, of the first byte
  std::array<std::uint32_t, kFrameStatusCount> counts_{};
};

// The frame, at the front of `wire`; or an empty span, with `wire` untouched, when `wire` is shorter than
// this frame or the payload longer than kPayloadBytesMax. `wire` must not overlap the payload. An empty
// payload gives a frame that decoders reject as kEmpty.
struct EncodedFrame {
  std::span<const std::uint8_t> bytes;
  bool ok() const { return !bytes.empty(); }
};
EncodedFrame EncodeFrame(std::span<const std::uint8_t> payload, std::span<std::uint8_t> wire,
                         FrameCheck check = FrameCheck::kFletcher16);

}  // namespace tiltproof::link
