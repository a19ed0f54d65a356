#include "link/length_framing.h"

#include <algorithm>
#include <utility>

#include "link/check.h"
#include "link/message_kind.h"

namespace tiltproof::link {
namespace {

class LengthPrefixed final : public CheckedFraming {
 public:
  LengthPrefixed(const LengthFormat& format, CheckKind check) : CheckedFraming(check) {
    Check(!format.sync.empty() && format.sync.size() <= LengthHeader::kSyncBytesMax,
          "a frame begins with 1 to 4 marks");
    Check(format.length_bytes == 1 || format.length_bytes == 2, "a length has one byte or two");
    std::copy(format.sync.begin(), format.sync.end(), header_.sync.begin());
    header_.sync_count = format.sync.size();
    header_.length_bytes = format.length_bytes;
    header_.payload_bytes_max =
        std::min(kPayloadBytesMax, format.length_bytes == 1 ? std::size_t{0xFF} : std::size_t{0xFFFF});
    header_.check_bytes = check_bytes();
  }

  std::string_view name() const override { return "length_prefixed"; }
  std::span<const std::uint8_t> opening() const override { return {}; }

  // The length of a payload that is too long for it wraps: such a frame is for a receiver to reject.
  void AppendBehindOpening(std::span<const std::uint8_t> payload, std::uint32_t damage,
                           std::vector<std::uint8_t>& to) const override {
    const auto sync = header_.Sync();
    to.insert(to.end(), sync.begin(), sync.end());
    for (std::size_t i = 0; i < header_.length_bytes; ++i)
      to.push_back(static_cast<std::uint8_t>(payload.size() >> 8 * i & 0xFF));
    AppendChecked(payload, damage, to);
  }

  std::optional<FrameParts> Split(std::span<const std::uint8_t> frame) const override {
    const std::size_t header_bytes = header_.sync_count + header_.length_bytes;
    if (frame.size() < header_bytes + header_.check_bytes ||
        !std::equal(header_.Sync().begin(), header_.Sync().end(), frame.begin()))
      return std::nullopt;
    const std::size_t payload_bytes = frame.size() - header_bytes - header_.check_bytes;
    for (std::size_t i = 0; i < header_.length_bytes; ++i)
      if (frame[header_.sync_count + i] != (payload_bytes >> 8 * i & 0xFF)) return std::nullopt;
    return SplitChecked(frame.subspan(header_bytes));
  }

  std::vector<ByteRole> Roles(std::span<const std::uint8_t> frame) const override {
    std::vector<ByteRole> roles(frame.size(), ByteRole::kPayload);
    std::vector<std::size_t> content;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (i < header_.sync_count) {
        roles[i] = ByteRole::kSync;
      } else if (i < header_.sync_count + header_.length_bytes) {
        roles[i] = ByteRole::kLength;
      } else {
        content.push_back(i);
      }
    }
    MarkCheck(content, roles);
    return roles;
  }

  std::unique_ptr<FrameReader> MakeReader() const override { return std::make_unique<Reader>(*this); }
  std::optional<FrameEnd> frame_end() const override { return header_; }

  std::optional<std::uint8_t> flag() const override { return std::nullopt; }
  std::optional<std::uint8_t> escape() const override { return std::nullopt; }
  std::span<const std::uint8_t> special_bytes() const override { return header_.Sync(); }

 private:
  class Reader final : public FrameReader {
   public:
    explicit Reader(const LengthPrefixed& framing) : framing_(framing), tracker_(framing.header_) {}

    std::optional<FrameReading> Next(std::span<const std::uint8_t>& bytes) override {
      while (!bytes.empty()) {
        if (const std::size_t left = tracker_.content_left_count(); left > 0) {
          const auto part = Consume(bytes, std::min(left, bytes.size()));
          content_.insert(content_.end(), part.begin(), part.end());
          if (tracker_.TakeContent(part.size()) == LengthTracker::Step::kFrameEnd) return Close();
          continue;
        }
        if (tracker_.is_outside()) {
          const auto mark = std::find(bytes.begin(), bytes.end(), framing_.header_.sync[0]);
          Consume(bytes, static_cast<std::size_t>(mark - bytes.begin()));
          if (bytes.empty()) break;
        }
        if (auto reading = Take(tracker_.Next(Consume(bytes, 1)[0]))) return reading;
      }
      return std::nullopt;
    }

    std::optional<FrameReading> Finish() override {
      tracker_.Reset();
      if (begin_ == offset_) return std::nullopt;
      return Reading(is_in_frame_ ? "aborted" : "no_sync", offset_);
    }

   private:
    std::span<const std::uint8_t> Consume(std::span<const std::uint8_t>& bytes, std::size_t count) {
      const auto part = bytes.first(count);
      bytes = bytes.subspan(count);
      offset_ += count;
      return part;
    }
    std::optional<FrameReading> Take(LengthTracker::Step step) {
      switch (step) {
        case LengthTracker::Step::kOutside:
        case LengthTracker::Step::kSync:
        case LengthTracker::Step::kLength:
          return std::nullopt;
        case LengthTracker::Step::kSyncEnd: {
          const std::uint64_t begin = offset_ - framing_.header_.sync_count;
          std::optional<FrameReading> stray;
          if (begin != begin_) stray = Reading("no_sync", begin);
          is_in_frame_ = true;
          return stray;
        }
        case LengthTracker::Step::kBadLength:
          return Reading("bad_length", offset_);
        case LengthTracker::Step::kContent:
        case LengthTracker::Step::kFrameEnd:
          break;  // Next() takes a content at once
      }
      ThrowBrokenInvariant("a step of a frame");
    }
    FrameReading Close() {
      closed_.swap(content_);
      const std::span<const std::uint8_t> content(closed_);
      const std::size_t check_bytes = framing_.check_bytes();
      const auto payload = content.first(content.size() - check_bytes);
      const bool is_right =
          LoadCheck(framing_.kind(), content.last(check_bytes)) == Checksum(framing_.kind(), payload);
      FrameReading reading = Reading(!is_right ? "bad_checksum" : payload.empty() ? "empty" : "ok", offset_);
      reading.payload = payload;
      return reading;
    }
    // The bytes up to `content_end` that no reading has are one.
    FrameReading Reading(std::string_view status, std::uint64_t content_end) {
      const std::uint64_t begin = std::exchange(begin_, content_end);
      content_.clear();
      is_in_frame_ = false;
      return {.status = status,
              .ok = status == "ok",
              .payload = {},
              .begin = begin,
              .end = offset_,
              .content_begin = begin,
              .content_end = content_end};
    }

    const LengthPrefixed& framing_;
    LengthTracker tracker_;
    std::vector<std::uint8_t> content_, closed_;  // of the frame that has begun; of the last one
    bool is_in_frame_ = false;
    std::uint64_t offset_ = 0, begin_ = 0;
  };

  LengthHeader header_;
};

}  // namespace

std::shared_ptr<const Framing> MakeLengthFraming(const LengthFormat& format, CheckKind check) {
  return std::make_shared<LengthPrefixed>(format, check);
}

}  // namespace tiltproof::link
