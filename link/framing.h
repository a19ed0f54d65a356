// A framing turns payloads into bytes of a line, and finds them in such bytes again. All that depends on the kind of
// framing is behind this interface, so that a protocol (link/protocol.h) can have any of them.
//
//   const std::vector<std::uint8_t> frame = framing.Encode(payload);
//
//   const std::unique_ptr<FrameReader> reader = framing.MakeReader();
//   while (auto frame = reader->Next(received)) {  // consumes `received` from its front
//     if (frame->ok) Use(frame->payload);
//   }
//
// A payload holds the id of its message, where the message has one (link/protocol.h). A framing with the id in its
// header takes it from there.
//
// A framing may have a flag: a byte that ends frames and stands nowhere in them. Frames with a length in front have
// none. Faults on flags and escapes need a framing that has these (faults/fault_type.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/checksum.h"
#include "link/frame_cutter.h"

namespace tiltproof::link {

// A frame that has ended, or bytes that are none.
struct FrameReading {
  std::string_view status;  // "ok", or why it is rejected: "bad_checksum", ... in `tiltproof frame decode`
  bool ok = false;
  // The payload of a whole frame; otherwise what is known of it. Valid until the reader's next call.
  std::span<const std::uint8_t> payload;
  // Offsets in the stream: its first byte, and one past the byte with which its end was known. Two frames may share a
  // flag between them.
  std::uint64_t begin = 0, end = 0;
  // The same without the flags at its ends.
  std::uint64_t content_begin = 0, content_end = 0;
};

// Reads one stream of bytes. The same bytes give the same frames, in any chunks.
class FrameReader {
 public:
  virtual ~FrameReader() = default;
  // Consumes bytes from the front of `bytes` up to the end of the next frame or rejection and returns it; nullopt
  // when all of `bytes` is consumed and none has ended.
  virtual std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) = 0;
  // The stream has ended, or its receiver drops what it holds; returns that, if it is anything. Bytes that follow are
  // read as by a new reader, but offsets go on counting.
  virtual std::optional<FrameReading> Finish() = 0;
};

// The purpose of a byte of a frame. kCode is COBS's distance to the next 00, which also stands for a 00 of payload or
// check; kSync marks the start of a frame with its length in front.
enum class ByteRole : std::uint8_t { kFlagByte, kEscapeByte, kCode, kSync, kLength, kPayload, kCheck };
constexpr ByteRole LastOf(ByteRole) { return ByteRole::kCheck; }
std::string_view Name(ByteRole role);  // "flag", "escape", ...

// A frame taken apart.
struct FrameParts {
  std::size_t opening_bytes = 0;  // in front of it: an opening, flags of an idle line
  std::vector<std::uint8_t> payload;
  std::uint32_t damage = 0;  // the bits in which its check is wrong
};

class Framing {
 public:
  virtual ~Framing() = default;

  virtual std::string_view name() const = 0;  // "hdlc"

  // The frame of a payload of any length, longer ones than a reader takes among them. The check is wrong in the bits
  // of `damage`.
  std::vector<std::uint8_t> Encode(std::span<const std::uint8_t> payload, std::uint32_t damage = 0) const;
  // Bytes in front of a frame on an idle line. They may be the end of the frame before; empty: there are none.
  virtual std::span<const std::uint8_t> opening() const = 0;
  // Appends such a frame without the opening.
  virtual void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                                   std::vector<std::uint8_t>& to) const = 0;
  // The reverse; nullopt when the bytes are not one frame with a payload and a check.
  virtual std::optional<FrameParts> Split(std::span<const std::uint8_t> frame) const = 0;

  // The role of each of these bytes, which are one frame. In a damaged one each byte has the role of its place.
  virtual std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const = 0;
  // True if its frames can have bytes of that role.
  bool Has(ByteRole role) const;

  virtual std::unique_ptr<FrameReader> MakeReader() const = 0;
  virtual std::unique_ptr<FrameCutter> MakeCutter() const;

  // The end of a frame; nullopt: neither a flag nor a length in front. Then MakeCutter() must be overridden.
  virtual std::optional<FrameEnd> frame_end() const;
  // The byte that ends a frame, and the one that announces an escaped byte; nullopt: there is none.
  virtual std::optional<std::uint8_t> flag() const = 0;
  virtual std::optional<std::uint8_t> escape() const = 0;
  // The check over the payload; nullopt: none of link/checksum.h.
  virtual std::optional<CheckKind> check() const { return std::nullopt; }
  // Length of the check behind the payload, at most 4; 0: there is none.
  virtual std::size_t check_bytes() const = 0;
  // Bytes that decoders treat in a special way; at least one.
  virtual std::span<const std::uint8_t> special_bytes() const = 0;

  // The second function makes such a change in `bytes`, which has blind_spot().bytes_count of them; `way` is below
  // ways_count. It returns a text for a person: "by 7, ...".
  virtual BlindSpot blind_spot() const { return {}; }
  virtual std::string ChangeUnseen(std::span<std::uint8_t> bytes, std::uint32_t way) const;
};

// A framing with one of the checks of link/checksum.h.
class CheckedFraming : public Framing {
 public:
  explicit CheckedFraming(CheckKind kind) : kind_(kind) {}
  CheckKind kind() const { return kind_; }
  std::optional<CheckKind> check() const override { return kind_; }
  std::size_t check_bytes() const override { return CheckBytes(kind_); }
  BlindSpot blind_spot() const override { return BlindSpotOf(kind_); }
  std::string ChangeUnseen(std::span<std::uint8_t> bytes, std::uint32_t way) const override {
    return link::ChangeUnseen(kind_, bytes, way);
  }

 protected:
  // Appends payload and check; the check is wrong in the bits of `damage`.
  void AppendChecked(std::span<const std::uint8_t> payload, std::uint32_t damage,
                     std::vector<std::uint8_t>& to) const;
  // The reverse, of all bytes between the ends of a frame; nullopt when they are shorter than a check.
  std::optional<FrameParts> SplitChecked(std::span<const std::uint8_t> content) const;
  // Payload becomes check at the last of these places, which have the bytes of payload and check in their order.
  void MarkCheck(std::span<const std::size_t> places, std::vector<ByteRole>& roles) const;

 private:
  CheckKind kind_;
};

// The number of flags in front of these bytes.
std::size_t CountFlags(const Framing& framing, std::span<const std::uint8_t> bytes);

}  // namespace tiltproof::link
