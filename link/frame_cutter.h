// Finds where frames end in a stream of bytes. A wire cuts there what is sent and what arrives, and in lockstep an
// emulated processor stops there: a receiver may answer.
//
//   FlagCutter cutter(0x7E);
//   while (auto size = cutter.FindEnd(bytes)) {
//     Use(bytes.first(*size));
//     bytes = bytes.subspan(*size);
//   }
//
// The standard library is all that this needs: the lockstep plug-in uses it too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <variant>

namespace tiltproof::link {

class FrameCutter {
 public:
  virtual ~FrameCutter() = default;
  // The number of bytes up to and with the first one that may end a frame; nullopt when there is none. It takes these
  // bytes, or all of them: a call goes on where the last one has ended.
  virtual std::optional<std::size_t> FindEnd(std::span<const std::uint8_t> bytes) = 0;
  // Drops a frame that has not ended: the next byte begins another one.
  virtual void Reset() = 0;
};

// A flag ends a frame when another byte came before it. So a flag shared by two frames belongs to the first of them,
// and flags of an idle line belong to the frame that follows.
class FlagCutter final : public FrameCutter {
 public:
  explicit FlagCutter(std::uint8_t flag) : flag_(flag) {}

  std::optional<std::size_t> FindEnd(std::span<const std::uint8_t> bytes) override {
    std::size_t at = 0;
    if (!in_frame_) {
      while (at < bytes.size() && bytes[at] == flag_) ++at;
      in_frame_ = at < bytes.size();
    }
    if (at == bytes.size()) return std::nullopt;
    const void* found = std::memchr(bytes.data() + at, flag_, bytes.size() - at);
    if (found == nullptr) return std::nullopt;
    in_frame_ = false;
    return static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - bytes.data()) + 1;
  }
  void Reset() override { in_frame_ = false; }

 private:
  std::uint8_t flag_;
  bool in_frame_ = false;
};

// The start of frames that have their length in front: bytes that mark it, and then the length of the payload.
struct LengthHeader {
  static constexpr std::size_t kSyncBytesMax = 4;
  std::array<std::uint8_t, kSyncBytesMax> sync{};  // the first sync_count
  std::size_t sync_count = 0;                      // 1 to kSyncBytesMax
  std::size_t length_bytes = 1;                    // 1 or 2, the low byte first
  std::size_t payload_bytes_max = 0;               // a longer payload is no frame
  std::size_t check_bytes = 0;

  std::span<const std::uint8_t> Sync() const { return std::span(sync).first(sync_count); }
};

// Follows a stream of such frames byte by byte, as the receivers of autopilots do: bytes that were taken for a frame are
// not read a second time, so a damaged length takes what follows for its payload.
class LengthTracker {
 public:
  explicit LengthTracker(const LengthHeader& header) : header_(header) {}

  enum class Step : std::uint8_t {
    kOutside,  // the byte is no part of a frame
    kSync,     // it belongs to the marks in front of a frame, as far as known
    kSyncEnd,  // it is the last one of the marks
    kLength,
    kBadLength,  // it completes a length that no frame has; the next byte is outside
    kContent,    // it belongs to payload or check
    kFrameEnd,   // it is the last one of a frame
  };
  Step Next(std::uint8_t byte) {
    switch (part_) {
      case Part::kSync:
        return NextSync(byte);
      case Part::kLength:
        return NextLength(byte);
      case Part::kContent:
        break;
    }
    if (--left_count_ > 0) return Step::kContent;
    Reset();
    return Step::kFrameEnd;
  }
  void Reset() {
    part_ = Part::kSync;
    matched_count_ = 0;
  }

  // True if no byte so far belongs to a frame that may follow.
  bool is_outside() const { return part_ == Part::kSync && matched_count_ == 0; }
  // Bytes of payload and check that are still to come; 0 in front of them.
  std::size_t content_left_count() const { return part_ == Part::kContent ? left_count_ : 0; }
  // The step of the last of so many of them: 1 to content_left_count().
  Step TakeContent(std::size_t count) {
    left_count_ -= count - 1;
    return Next(0);
  }

 private:
  enum class Part : std::uint8_t { kSync, kLength, kContent };

  Step NextSync(std::uint8_t byte) {
    // The longest part of the marks that ends with this byte.
    while (matched_count_ > 0 && header_.sync[matched_count_] != byte)
      matched_count_ = Shorter(matched_count_);
    if (header_.sync[matched_count_] != byte) return Step::kOutside;
    if (++matched_count_ < header_.sync_count) return Step::kSync;
    part_ = Part::kLength;
    length_ = length_count_ = 0;
    return Step::kSyncEnd;
  }
  Step NextLength(std::uint8_t byte) {
    length_ |= std::size_t{byte} << 8 * length_count_;
    if (++length_count_ < header_.length_bytes) return Step::kLength;
    left_count_ = length_ + header_.check_bytes;
    if (length_ > header_.payload_bytes_max || left_count_ == 0) {
      Reset();
      return Step::kBadLength;
    }
    part_ = Part::kContent;
    return Step::kLength;
  }
  // The longest shorter part of the marks with which their first `count` bytes end.
  std::size_t Shorter(std::size_t count) const {
    for (std::size_t size = count - 1; size > 0; --size)
      if (std::memcmp(header_.sync.data(), header_.sync.data() + (count - size), size) == 0) return size;
    return 0;
  }

  LengthHeader header_;
  Part part_ = Part::kSync;
  std::size_t matched_count_ = 0, length_ = 0, length_count_ = 0, left_count_ = 0;
};

class LengthCutter final : public FrameCutter {
 public:
  explicit LengthCutter(const LengthHeader& header) : tracker_(header) {}

  std::optional<std::size_t> FindEnd(std::span<const std::uint8_t> bytes) override {
    for (std::size_t at = 0; at < bytes.size(); ++at)
      if (tracker_.Next(bytes[at]) == LengthTracker::Step::kFrameEnd) return at + 1;
    return std::nullopt;
  }
  void Reset() override { tracker_.Reset(); }

 private:
  LengthTracker tracker_;
};

// Where frames end, as data: a flag, or a length in front of them.
using FrameEnd = std::variant<std::uint8_t, LengthHeader>;

inline std::unique_ptr<FrameCutter> MakeFrameCutter(const FrameEnd& end) {
  if (const auto* header = std::get_if<LengthHeader>(&end)) return std::make_unique<LengthCutter>(*header);
  return std::make_unique<FlagCutter>(*std::get_if<std::uint8_t>(&end));
}

}  // namespace tiltproof::link
