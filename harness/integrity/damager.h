// Damage of one frame, many times, and how many wrong frames come through.
//
//   Damager damager(sample, group);
//   damager.MakeBurst(random, 32);
//   damager.Judge();
//
// A receiver needs to be asked about few of them: where only bytes of payload and check have changed, a table has the
// effect of each new byte on the check (CheckGroup), and a check that is wrong ends the matter.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "faults/random.h"
#include "harness/integrity/check_group.h"
#include "harness/integrity/frame_sample.h"

namespace tiltproof::harness {

struct Counts {
  std::int64_t frames = 0, passed_check = 0, passed_length = 0, delivered_wrong = 0;
  Counts& operator+=(const Counts& other);
};

class Damager {
 public:
  // Both must outlive it; the group is that of the sample's contents.
  Damager(const FrameSample& sample, const CheckGroup& group);

  std::size_t bits_count() const { return 8 * wire_.size(); }

  // Each of them changes the frame further, up to the next Judge().
  void FlipBit(std::size_t bit) { Set(bit / 8, damaged_[bit / 8] ^ 1U << bit % 8); }
  // The first and the last of `length` bits are wrong, those between them at random.
  void MakeBurst(faults::Random& random, std::size_t length);
  // So many bytes in a row read 00, or FF.
  void StickBytes(faults::Random& random, std::size_t count);
  // So many times, neighbours change places. A byte may move on that way.
  void SwapBytes(faults::Random& random, std::size_t count);

  // The frame as it is now.
  std::span<const std::uint8_t> damaged() const { return damaged_; }
  // Counts what comes through, and makes the frame intact again.
  Received Judge();
  // Counts what comes through of an intact frame with so many wrong bits; `count` is at most bits_count().
  Received JudgeWithWrongBits(faults::Random& random, std::size_t count);
  // Counts what comes through of one that has lost bytes, or has random ones added.
  Received JudgeWithLost(faults::Random& random, std::size_t count);
  Received JudgeWithAdded(faults::Random& random, std::size_t count);
  // The frame of the last call of these three.
  std::span<const std::uint8_t> other() const { return other_; }
  // Counts all frames with one to three wrong bits of which `first` is the first one.
  void JudgeAllFrom(std::size_t first, int count);

  const Counts& counts() const { return counts_; }

 private:
  // The highest bit of an effect: the receiver must be asked.
  static constexpr std::uint64_t kAsk = std::uint64_t{1} << 63;

  void Set(std::size_t place, std::uint32_t byte) {
    if (!is_touched_[place]) {
      is_touched_[place] = true;
      places_.push_back(static_cast<std::uint32_t>(place));
    }
    damaged_[place] = static_cast<std::uint8_t>(byte);
  }
  std::uint64_t EffectOf(std::size_t place, std::uint8_t byte) const { return effects_[256 * place + byte]; }
  // False only if the receiver finds the frame where it was sent, and its check wrong; or nothing has changed.
  bool MayPass() const;
  // The same of other_, in which these bits are wrong. `any` has the flags of their effects, `total` is their sum.
  bool MayPass(std::span<const std::uint32_t> bits, std::uint64_t total, std::uint64_t any) const;
  void JudgeLastBit(std::size_t from);
  void Lengthen(const FrameSample& sample);
  Received Add(const Received& received);

  const CheckGroup& group_;
  FrameReceiver receiver_;
  std::vector<std::uint8_t> wire_, damaged_, other_;
  std::vector<std::uint64_t> effects_;      // of each value of each byte of the frame
  std::vector<std::uint64_t> bit_effects_;  // of each bit that alone is wrong in its byte
  // The effects of bits that add up to those of several bits. Flags and marks have none; see MayPass().
  std::vector<std::uint64_t> added_effects_;
  // Effects when the closing flag is a byte of the content: the group, the intact frame, and the bits.
  std::optional<CheckGroup> longer_;
  std::uint64_t longer_effect_ = 0;
  std::vector<std::uint64_t> longer_effects_;
  std::size_t marks_count_;
  std::vector<std::uint32_t> wrong_bits_;
  std::array<std::uint64_t, 256> asks_{};  // kAsk for values that may change how other bytes are read
  std::vector<std::uint8_t> is_touched_;   // for each byte of the frame
  std::vector<std::uint32_t> places_;      // of bytes that are touched
  Counts counts_;
};

}  // namespace tiltproof::harness
