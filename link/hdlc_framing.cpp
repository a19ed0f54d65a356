#include "link/hdlc_framing.h"

#include <array>

#include "link/check.h"
#include "link/fletcher16.h"
#include "link/frame.h"

namespace tiltproof::link {
namespace {

constexpr std::size_t kCheckBytes = 2;
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

class HdlcReader : public FrameReader {
 public:
  std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
    const std::optional<FrameEvent> event = decoder_.Next(bytes);
    if (!event) return std::nullopt;
    return Reading(*event, event->status != FrameStatus::kTooLong);
  }
  std::optional<FrameReading> Finish() override {
    const std::optional<FrameEvent> event = decoder_.Finish();
    if (!event) return std::nullopt;
    return Reading(*event, false);
  }

 private:
  // `has_flag`: a flag was the last byte of the event.
  static FrameReading Reading(const FrameEvent& event, bool has_flag) {
    const bool is_open = event.status != FrameStatus::kNoOpeningFlag;
    return {.status = Name(event.status),
            .ok = event.status == FrameStatus::kOk,
            .payload = event.payload,
            .begin = event.begin,
            .end = event.end,
            .content_begin = event.begin + (is_open ? 1 : 0),
            .content_end = event.end - (has_flag ? 1 : 0)};
  }

  FrameDecoder decoder_;
};

class Hdlc : public Framing {
 public:
  std::string_view name() const override { return "hdlc"; }
  std::span<const std::uint8_t> opening() const override { return kOpening; }

  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                           std::vector<std::uint8_t>& to) const override {
    const std::uint32_t check = Fletcher16(payload) ^ damage;
    const std::size_t size = to.size();
    to.resize(size + FrameBytesMax(payload.size()));
    std::uint8_t* out = to.data() + size;
    for (const std::uint8_t byte : payload) out = PutEscaped(out, byte);
    out = PutEscaped(out, static_cast<std::uint8_t>(check & 0xFF));
    out = PutEscaped(out, static_cast<std::uint8_t>(check >> 8 & 0xFF));
    *out++ = kFlag;
    to.resize(static_cast<std::size_t>(out - to.data()));
  }

  std::optional<FrameParts> TakeApart(std::span<const std::uint8_t> frame) const override {
    FrameParts parts{.opening_bytes = CountFlags(*this, frame), .payload = {}};
    if (parts.opening_bytes == frame.size() || frame.back() != kFlag) return std::nullopt;
    const std::span<const std::uint8_t> content =
        frame.subspan(parts.opening_bytes, frame.size() - parts.opening_bytes - 1);
    std::vector<std::uint8_t>& payload = parts.payload;
    payload.reserve(content.size());
    for (std::size_t i = 0; i < content.size(); ++i) {
      if (content[i] == kFlag) return std::nullopt;
      const bool escaped = content[i] == kEscape;
      if (escaped && ++i == content.size()) return std::nullopt;
      payload.push_back(static_cast<std::uint8_t>(content[i] ^ (escaped ? kEscapeXor : 0)));
    }
    if (payload.size() < kCheckBytes) return std::nullopt;
    const auto check = static_cast<std::uint32_t>(payload[payload.size() - 2] | payload.back() << 8);
    payload.resize(payload.size() - kCheckBytes);
    parts.damage = check ^ Fletcher16(payload);
    return parts;
  }

  std::unique_ptr<FrameReader> MakeReader() const override { return std::make_unique<HdlcReader>(); }
  std::unique_ptr<FrameCutter> MakeCutter() const override { return std::make_unique<FlagCutter>(kFlag); }

  std::optional<std::uint8_t> flag() const override { return kFlag; }
  std::optional<std::uint8_t> escape() const override { return kEscape; }
  std::size_t check_bytes() const override { return kCheckBytes; }
  std::span<const std::uint8_t> special_bytes() const override { return kSpecialBytes; }

  // Three bytes that change by d, -2d and d modulo 255 change neither of Fletcher's sums.
  BlindSpot blind_spot() const override { return {.bytes_count = 3, .ways_count = kFletcherModulus - 1}; }
  std::string ChangeUnseen(std::span<std::uint8_t> bytes, std::uint32_t way) const override {
    Check(bytes.size() == 3 && way < kFletcherModulus - 1, "a change in Fletcher's blind spot");
    const std::uint32_t d = 1 + way;
    const std::array<std::uint32_t, 3> differences = {d, 2 * (kFletcherModulus - d), d};
    for (std::size_t i = 0; i < bytes.size(); ++i)
      bytes[i] = static_cast<std::uint8_t>((bytes[i] + differences[i]) % kFletcherModulus);
    return "by " + std::to_string(d) + ", -2 times that, and that again";
  }
};

}  // namespace

const std::shared_ptr<const Framing>& HdlcFraming() {
  static const std::shared_ptr<const Framing> framing = std::make_shared<Hdlc>();
  return framing;
}

}  // namespace tiltproof::link
