#include "link/cobs_framing.h"

#include <algorithm>
#include <array>
#include <utility>

#include "link/message_kind.h"

namespace tiltproof::link {
namespace {

constexpr std::uint8_t kDelimiter = 0x00;
constexpr std::uint8_t kFullBlock = 0xFF;  // the code of 254 bytes that no 00 follows
// The delimiter, the codes of an empty and of a full block, and the longest block that a 00 follows.
constexpr std::array<std::uint8_t, 4> kCobsSpecialBytes = {kDelimiter, 0x01, kFullBlock, 0xFE};

// Longest content of a frame with a payload of kPayloadBytesMax: one code in front, and one more for each full block.
constexpr std::size_t ContentBytesMax(std::size_t check_bytes) {
  const std::size_t bytes = kPayloadBytesMax + check_bytes;
  return bytes + 1 + bytes / (kFullBlock - 1);
}

// Undoes the stuffing of a frame's content, which has no 00; nullopt when a code reaches beyond its end.
std::optional<std::vector<std::uint8_t>> Unstuff(std::span<const std::uint8_t> content) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(content.size());
  while (!content.empty()) {
    const std::size_t code = content.front();
    if (code > content.size()) return std::nullopt;
    bytes.insert(bytes.end(), content.begin() + 1, content.begin() + static_cast<std::ptrdiff_t>(code));
    content = content.subspan(code);
    if (code < kFullBlock && !content.empty()) bytes.push_back(0x00);
  }
  return bytes;
}

class Cobs final : public CheckedFraming {
 public:
  using CheckedFraming::CheckedFraming;

  std::string_view name() const override { return "cobs"; }
  std::span<const std::uint8_t> opening() const override { return {}; }

  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                           std::vector<std::uint8_t>& to) const override {
    std::vector<std::uint8_t> all;
    AppendChecked(payload, damage, all);
    std::size_t code = to.size();
    to.push_back(1);
    for (const std::uint8_t byte : all) {
      if (to[code] == kFullBlock) {
        code = to.size();
        to.push_back(1);
      }
      if (byte != 0x00) {
        to.push_back(byte);
        ++to[code];
      } else {
        code = to.size();
        to.push_back(1);
      }
    }
    to.push_back(kDelimiter);
  }

  std::optional<FrameParts> Split(std::span<const std::uint8_t> frame) const override {
    const std::size_t opening_bytes = CountFlags(*this, frame);
    const auto content = frame.subspan(opening_bytes);
    if (content.empty() || std::find(content.begin(), content.end(), kDelimiter) != content.end() - 1)
      return std::nullopt;
    const auto bytes = Unstuff(content.first(content.size() - 1));
    std::optional<FrameParts> parts = bytes ? SplitChecked(*bytes) : std::nullopt;
    if (parts) parts->opening_bytes = opening_bytes;
    return parts;
  }

  std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const override {
    std::vector<ByteRole> roles;
    std::vector<std::size_t> content;
    std::size_t left = 0;     // bytes of the block that are still to come
    bool follows_00 = false;  // the next code stands for one, too
    for (std::size_t i = 0; i < frame.size(); ++i) {
      ByteRole role = ByteRole::kPayload;
      if (frame[i] == kDelimiter) {
        role = ByteRole::kFlag;
        left = 0;
        follows_00 = false;
      } else if (left == 0) {
        role = ByteRole::kCode;
        if (follows_00) content.push_back(i);
        left = frame[i] - std::size_t{1};
        follows_00 = frame[i] < kFullBlock;
      } else {
        --left;
        content.push_back(i);
      }
      roles.push_back(role);
    }
    MarkCheck(content, roles);
    return roles;
  }

  std::unique_ptr<FrameReader> MakeReader() const override { return std::make_unique<Reader>(*this); }

  std::optional<std::uint8_t> flag() const override { return kDelimiter; }
  std::optional<std::uint8_t> escape() const override { return std::nullopt; }
  std::span<const std::uint8_t> special_bytes() const override { return kCobsSpecialBytes; }

 private:
  class Reader final : public FrameReader {
   public:
    explicit Reader(const Cobs& framing) : framing_(framing) {}

    std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
      while (!bytes.empty()) {
        const std::uint8_t byte = bytes.front();
        bytes = bytes.subspan(1);
        ++offset_;
        if (byte == kDelimiter) {
          const bool silent = is_skipping_ || content_.empty();
          is_skipping_ = false;
          if (silent) begin_ = offset_;
          if (!silent) return Close();
        } else if (is_skipping_) {
          continue;
        } else if (content_.size() == ContentBytesMax(framing_.check_bytes())) {
          is_skipping_ = true;
          return Reading("too_long", 0);
        } else {
          content_.push_back(byte);
        }
      }
      return std::nullopt;
    }

    std::optional<FrameReading> Finish() override {
      const bool is_open = !content_.empty();
      is_skipping_ = false;
      if (is_open) return Reading("aborted", 0);
      begin_ = offset_;
      return std::nullopt;
    }

   private:
    FrameReading Close() {
      const auto bytes = Unstuff(content_);
      const std::optional<FrameParts> parts = bytes ? framing_.SplitChecked(*bytes) : std::nullopt;
      payload_ = parts ? parts->payload : std::vector<std::uint8_t>();
      if (!bytes) return Reading("bad_code", 1);
      if (!parts) return Reading("too_short", 1);
      if (payload_.size() > kPayloadBytesMax) {
        payload_.resize(kPayloadBytesMax);
        return Reading("too_long", 1);
      }
      if (parts->damage != 0) return Reading("bad_checksum", 1);
      return Reading(parts->payload.empty() ? "empty" : "ok", 1);
    }
    // The bytes since the last frame are one.
    FrameReading Reading(std::string_view status, std::uint64_t delimiter_bytes) {
      const std::uint64_t begin = std::exchange(begin_, offset_);
      content_.clear();
      if (delimiter_bytes == 0) payload_.clear();
      return {.status = status,
              .ok = status == "ok",
              .payload = payload_,
              .begin = begin,
              .end = offset_,
              .content_begin = begin,
              .content_end = offset_ - delimiter_bytes};
    }

    const Cobs& framing_;
    std::vector<std::uint8_t> content_, payload_;
    bool is_skipping_ = false;  // a frame that is too long has been reported
    std::uint64_t offset_ = 0, begin_ = 0;
  };
};

}  // namespace

std::shared_ptr<const Framing> MakeCobsFraming(CheckKind check) { return std::make_shared<Cobs>(check); }

}  // namespace tiltproof::link
