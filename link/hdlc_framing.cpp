#include "link/hdlc_framing.h"

#include <algorithm>
#include <array>

#include "link/check.h"
#include "link/frame.h"

namespace tiltproof::link {
namespace {

constexpr std::array<std::uint8_t, 1> kOpening = {kFlag};
// Flag and escape, both as they are escaped, the two bytes that are one number to Fletcher's checksum, and the bit that
// escapes.
constexpr std::array<std::uint8_t, 7> kSpecialBytes = {kFlag, kEscape, 0x5E, 0x5D, 0x00, 0xFF, kEscapeXor};

std::uint8_t* PutEscaped(std::uint8_t* out, std::uint8_t byte) {
  if (byte == kFlag || byte == kEscape) {
    *out++ = kEscape;
    byte ^= kEscapeXor;
  }
  *out++ = byte;
  return out;
}

// `has_flag`: a flag was the last byte of the event.
FrameReading ToReading(const FrameEvent& event, bool has_flag) {
  const bool is_open = event.status != FrameStatus::kNoOpeningFlag;
  return {.status = Name(event.status),
          .ok = event.status == FrameStatus::kOk,
          .payload = event.payload,
          .begin = event.begin,
          .end = event.end,
          .content_begin = event.begin + (is_open ? 1 : 0),
          .content_end = event.end - (has_flag ? 1 : 0)};
}

// Reads frames with Fletcher-16 by the codec.
class CodecReader final : public FrameReader {
 public:
  std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
    const std::optional<FrameEvent> event = decoder_.Next(bytes);
    if (!event) return std::nullopt;
    return ToReading(*event, event->status != FrameStatus::kTooLong);
  }
  std::optional<FrameReading> Finish() override {
    const std::optional<FrameEvent> event = decoder_.Finish();
    if (!event) return std::nullopt;
    return ToReading(*event, false);
  }

 private:
  FrameDecoder decoder_;
};

class Hdlc final : public CheckedFraming {
 public:
  using CheckedFraming::CheckedFraming;

  std::string_view name() const override { return "hdlc"; }
  std::span<const std::uint8_t> opening() const override { return kOpening; }

  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                           std::vector<std::uint8_t>& to) const override {
    const std::uint32_t check = Checksum(kind(), payload) ^ damage;
    const std::size_t size = to.size();
    to.resize(size + 2 * (payload.size() + check_bytes()) + 1);
    std::uint8_t* out = to.data() + size;
    for (const std::uint8_t byte : payload) out = PutEscaped(out, byte);
    for (std::size_t i = 0; i < check_bytes(); ++i) out = PutEscaped(out, CheckByte(kind(), check, i));
    *out++ = kFlag;
    to.resize(static_cast<std::size_t>(out - to.data()));
  }

  std::optional<FrameParts> Split(std::span<const std::uint8_t> frame) const override {
    const std::size_t opening_bytes = CountFlags(*this, frame);
    if (opening_bytes == frame.size() || frame.back() != kFlag) return std::nullopt;
    const std::span<const std::uint8_t> content =
        frame.subspan(opening_bytes, frame.size() - opening_bytes - 1);
    std::vector<std::uint8_t> bytes;
    bytes.reserve(content.size());
    for (std::size_t i = 0; i < content.size(); ++i) {
      if (content[i] == kFlag) return std::nullopt;
      const bool escaped = content[i] == kEscape;
      if (escaped && ++i == content.size()) return std::nullopt;
      bytes.push_back(static_cast<std::uint8_t>(content[i] ^ (escaped ? kEscapeXor : 0)));
    }
    std::optional<FrameParts> parts = SplitChecked(bytes);
    if (parts) parts->opening_bytes = opening_bytes;
    return parts;
  }

  std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const override {
    std::vector<ByteRole> roles;
    std::vector<std::size_t> content;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const bool is_escaped = i > 0 && roles.back() == ByteRole::kEscapeByte;
      const ByteRole role = frame[i] == kFlag                    ? ByteRole::kFlagByte
                            : frame[i] == kEscape && !is_escaped ? ByteRole::kEscapeByte
                                                                 : ByteRole::kPayload;
      if (role == ByteRole::kPayload) content.push_back(i);
      roles.push_back(role);
    }
    MarkCheck(content, roles);
    return roles;
  }

  std::unique_ptr<FrameReader> MakeReader() const override {
    if (kind() == CheckKind::kFletcher16) return std::make_unique<CodecReader>();
    return std::make_unique<Reader>(*this);
  }

  std::optional<std::uint8_t> flag() const override { return kFlag; }
  std::optional<std::uint8_t> escape() const override { return kEscape; }
  std::span<const std::uint8_t> special_bytes() const override { return kSpecialBytes; }

 private:
  // Reads frames with any check, and gives the readings that the codec gives.
  class Reader final : public FrameReader {
   public:
    explicit Reader(const Hdlc& framing) : framing_(framing) {}

    std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
      while (!bytes.empty()) {
        const std::uint8_t byte = bytes.front();
        bytes = bytes.subspan(1);
        ++offset_;
        if (auto reading = byte == kFlag ? TakeFlag() : TakeByte(byte)) return reading;
      }
      return std::nullopt;
    }

    std::optional<FrameReading> Finish() override {
      std::optional<FrameReading> reading;
      if (state_ == State::kEscaped || (state_ == State::kInFrame && !content_.empty())) {
        reading = Reading(FrameStatus::kAborted, content_, false);
      } else if (state_ == State::kHunting && begin_ != offset_) {
        reading = Reading(FrameStatus::kNoOpeningFlag, {}, false);
      }
      state_ = State::kHunting;
      begin_ = offset_;
      return reading;
    }

   private:
    enum class State : std::uint8_t { kHunting, kInFrame, kEscaped, kSkipping };

    std::optional<FrameReading> TakeFlag() {
      std::optional<FrameReading> reading;
      if (state_ == State::kHunting && begin_ != offset_ - 1) {
        reading = Reading(FrameStatus::kNoOpeningFlag, {}, true);
      } else if (state_ == State::kEscaped) {
        reading = Reading(FrameStatus::kDanglingEscape, content_, true);
      } else if (state_ == State::kInFrame && !content_.empty()) {
        reading = Close();
      }
      state_ = State::kInFrame;
      content_.clear();
      begin_ = offset_ - 1;
      return reading;
    }
    std::optional<FrameReading> TakeByte(std::uint8_t byte) {
      if (state_ == State::kHunting || state_ == State::kSkipping) return std::nullopt;
      if (state_ == State::kInFrame && byte == kEscape) {
        state_ = State::kEscaped;
        return std::nullopt;
      }
      if (content_.size() == kPayloadBytesMax + framing_.check_bytes()) {
        state_ = State::kSkipping;
        return Reading(FrameStatus::kTooLong, content_, false);
      }
      content_.push_back(static_cast<std::uint8_t>(byte ^ (state_ == State::kEscaped ? kEscapeXor : 0)));
      state_ = State::kInFrame;
      return std::nullopt;
    }
    FrameReading Close() {
      const std::optional<FrameParts> parts = framing_.SplitChecked(content_);
      if (!parts) return Reading(FrameStatus::kTooShort, content_, true);
      const FrameStatus status = parts->damage != 0       ? FrameStatus::kBadChecksum
                                 : parts->payload.empty() ? FrameStatus::kEmpty
                                                          : FrameStatus::kOk;
      return Reading(status, parts->payload, true);
    }
    FrameReading Reading(FrameStatus status, std::span<const std::uint8_t> payload, bool has_flag) {
      payload_.assign(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(
                                                             std::min(payload.size(), kPayloadBytesMax)));
      return ToReading({status, payload_, begin_, offset_}, has_flag);
    }

    const Hdlc& framing_;
    State state_ = State::kHunting;
    std::vector<std::uint8_t> content_, payload_;
    std::uint64_t offset_ = 0, begin_ = 0;
  };
};

}  // namespace

const std::shared_ptr<const Framing>& HdlcFraming() {
  static const std::shared_ptr<const Framing> framing = std::make_shared<Hdlc>(CheckKind::kFletcher16);
  return framing;
}

std::shared_ptr<const Framing> MakeHdlcFraming(CheckKind check) {
  if (check == CheckKind::kFletcher16) return HdlcFraming();
  return std::make_shared<Hdlc>(check);
}

}  // namespace tiltproof::link
