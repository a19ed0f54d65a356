// Three frames of a message on a line, one behind the other, and what a receiver makes of them when the one in the middle
// is damaged.
//
//   const FrameSample sample(protocol, *protocol.Find("sensors"), random);
//   const Received received = sample.Receive(damaged);  // in place of sample.wire()
//
// Most damage changes only bytes of payload and check. For it the receiver need not be asked: FrameCheck computes from
// the changed bytes alone if the check still holds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "faults/random.h"
#include "link/framing.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// Frames that were delivered although they equal none of the three.
struct Received {
  int passed_check_count = 0;  // by the framing
  int accepted_count = 0;      // by the message's length, id and ranges, too
};

class FrameSample {
 public:
  // The values of the message's fields are drawn, within a hundredth of their plausible range. The protocol must
  // outlive the sample.
  FrameSample(const link::Protocol& protocol, const link::MessageType& type, faults::Random& random);

  // The frame in the middle as it travels, with the bytes that open and close it.
  std::span<const std::uint8_t> wire() const { return frames_[1]; }
  // Its payload and check.
  std::span<const std::uint8_t> content() const { return content_; }

  Received Receive(std::span<const std::uint8_t> damaged) const;

  // The place in content() of the value that a byte of wire() carries, when a change of that byte changes this value
  // alone, in the same bits. kNone: the byte is a part of the framing.
  static constexpr std::size_t kNone = ~std::size_t{};
  std::size_t ContentPlace(std::size_t wire_place) const { return places_[wire_place]; }
  // True if a byte of this value may change how others are read.
  bool IsSpecial(std::uint8_t byte) const { return is_special_[byte]; }

 private:
  std::vector<std::uint8_t> ContentOf(std::span<const std::uint8_t> frame) const;
  std::size_t FindPlace(std::size_t wire_place) const;

  const link::Protocol* protocol_;
  const link::MessageType* type_;
  std::array<std::vector<std::uint8_t>, 3> payloads_, frames_;
  std::vector<std::uint8_t> content_;
  std::vector<std::size_t> places_;
  std::array<bool, 256> is_special_{};
};

// A check under changes of single bytes of payload and check, one after the other.
class FrameCheck {
 public:
  FrameCheck(link::CheckKind kind, std::size_t content_bytes);

  // The changes that follow are of this content, whose check holds.
  void Begin(std::span<const std::uint8_t> content);
  // At most one change of each byte.
  void Change(std::size_t place, std::uint8_t from, std::uint8_t to);
  bool Holds() const;

 private:
  bool is_linear() const { return !syndromes_.empty(); }

  link::CheckKind kind_;
  std::size_t payload_bytes_;
  std::vector<std::array<std::uint32_t, 256>>
      syndromes_;  // for a CRC: by place, and by the bits that change there
  std::uint32_t syndrome_ = 0;
  // For sums: their change, and the check's bytes.
  std::int64_t sum1_ = 0, sum2_ = 0;
  std::array<std::int64_t, 2> check_{};
};

}  // namespace tiltproof::harness
