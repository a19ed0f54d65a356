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

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

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

}  // namespace tiltproof::link
