#include "link/cobs_framing.h"

#include <algorithm>
#include <array>
#include <cstring>
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

// Undoes the stuffing of a frame's content, which has no 00, into `bytes`. False when a code reaches beyond its end.
bool Unstuff(std::span<const std::uint8_t> content, std::vector<std::uint8_t>& bytes) {
  bytes.resize(content.size());
  std::uint8_t* out = bytes.data();
  while (!content.empty()) {
    const std::size_t code = content.front();
    if (code > content.size()) return false;
    out = std::copy_n(content.data() + 1, code - 1, out);
    content = content.subspan(code);
    if (code < kFullBlock && !content.empty()) *out++ = 0x00;
  }
  bytes.resize(static_cast<std::size_t>(out - bytes.data()));
  return true;
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
    std::vector<std::uint8_t> bytes;
    const bool is_whole = Unstuff(content.first(content.size() - 1), bytes);
    std::optional<FrameParts> parts = is_whole ? SplitChecked(bytes) : std::nullopt;
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
        role = ByteRole::kFlagByte;
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
        if (bytes.front() == kDelimiter) {
          Consume(bytes, 1);
          const bool silent = is_skipping_ || content_.empty();
          is_skipping_ = false;
          if (!silent) return Close();
          begin_ = offset_;
          continue;
        }
        const void* delimiter = std::memchr(bytes.data(), kDelimiter, bytes.size());
        std::size_t count =
            delimiter == nullptr
                ? bytes.size()
                : static_cast<std::size_t>(static_cast<const std::uint8_t*>(delimiter) - bytes.data());
        if (is_skipping_) {
          Consume(bytes, count);
          continue;
        }
        count = std::min(count, ContentBytesMax(framing_.check_bytes()) - content_.size());
        if (count == 0) {
          Consume(bytes, 1);
          is_skipping_ = true;
          return Reading("too_long", 0);
        }
        content_.insert(content_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
        Consume(bytes, count);
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
    void Consume(std::span<const std::uint8_t>& bytes, std::size_t count) {
      bytes = bytes.subspan(count);
      offset_ += count;
    }
    FrameReading Close() {
      payload_ = {};
      if (!Unstuff(content_, unstuffed_)) return Reading("bad_code", 1);
      const std::size_t check_bytes = framing_.check_bytes();
      if (unstuffed_.size() < check_bytes) return Reading("too_short", 1);
      const std::span<const std::uint8_t> content(unstuffed_);
      const auto payload = content.first(content.size() - check_bytes), check = content.last(check_bytes);
      payload_ = payload.first(std::min(payload.size(), kPayloadBytesMax));
      if (payload.size() > kPayloadBytesMax) return Reading("too_long", 1);
      if (LoadCheck(framing_.kind(), check) != Checksum(framing_.kind(), payload))
        return Reading("bad_checksum", 1);
      return Reading(payload.empty() ? "empty" : "ok", 1);
    }
    // The bytes since the last frame are one.
    FrameReading Reading(std::string_view status, std::uint64_t delimiter_bytes) {
      const std::uint64_t begin = std::exchange(begin_, offset_);
      content_.clear();
      if (delimiter_bytes == 0) payload_ = {};
      return {.status = status,
              .ok = status == "ok",
              .payload = payload_,
              .begin = begin,
              .end = offset_,
              .content_begin = begin,
              .content_end = offset_ - delimiter_bytes};
    }

    const Cobs& framing_;
    std::vector<std::uint8_t> content_, unstuffed_;
    std::span<const std::uint8_t> payload_;  // of unstuffed_
    bool is_skipping_ = false;               // a frame that is too long has been reported
    std::uint64_t offset_ = 0, begin_ = 0;
  };
};

}  // namespace

std::shared_ptr<const Framing> MakeCobsFraming(CheckKind check) { return std::make_shared<Cobs>(check); }

}  // namespace tiltproof::link
