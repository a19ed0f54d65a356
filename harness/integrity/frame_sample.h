// Three frames of a message on a line, one behind the other, and what a receiver makes of them when the one in the middle
// is damaged.
//
//   const FrameSample sample(protocol, *protocol.Find("reply"), random);
//   const Received received = sample.Receive(damaged);  // in place of sample.wire()
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "faults/random.h"
#include "link/framing.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// Frames that were delivered although they equal none of the three. Each number counts some of those before it.
struct Received {
  int passed_check_count = 0;   // by the framing
  int passed_length_count = 0;  // with the id and the exact length of a message
  int accepted_count = 0;       // with values in their ranges
  friend bool operator==(const Received&, const Received&) = default;
};

class FrameSample {
 public:
  // The values of the message's fields are drawn, within a hundredth of their plausible range around its middle. The
  // protocol must outlive the sample.
  FrameSample(const link::Protocol& protocol, const link::MessageType& type, faults::Random& random);

  // The frame in the middle as it travels, with the bytes that open and close it.
  std::span<const std::uint8_t> wire() const { return frames_[1]; }
  // Its payload and check.
  std::span<const std::uint8_t> content() const { return content_; }

  // A receiver's view of all three frames.
  Received Receive(std::span<const std::uint8_t> damaged) const;

  // The place in content() of the value that a byte of wire() carries, when a change of that byte changes this value
  // alone, in the same bits. kNone: the byte is a part of the framing.
  static constexpr std::size_t kNone = ~std::size_t{};
  std::size_t ContentPlace(std::size_t wire_place) const { return places_[wire_place]; }
  // True if the first byte of wire() ends the frame before, and the last one ends this frame: a receiver that takes one of
  // them for another byte has that byte in front of the content, or behind it.
  bool IsBetweenFlags() const;
  // The bytes at the start of wire() without which a receiver hears nothing until they come again. Empty: there are none.
  std::span<const std::uint8_t> Marks() const { return std::span(frames_[1]).first(marks_count_); }
  // True if a byte of this value may change how others are read.
  bool IsSpecial(std::uint8_t byte) const { return is_special_[byte]; }

 private:
  friend class FrameReceiver;

  std::vector<std::uint8_t> ContentOf(std::span<const std::uint8_t> frame) const;
  std::size_t FindPlace(std::size_t wire_place) const;
  void Count(const link::FrameReading& reading, Received& received) const;

  const link::Protocol* protocol_;
  const link::MessageType* type_;
  std::array<std::vector<std::uint8_t>, 3> payloads_, frames_;
  std::vector<std::uint8_t> content_;
  std::vector<std::size_t> places_;
  std::array<bool, 256> is_special_{};
  std::size_t marks_count_ = 0;
};

// Says the same as FrameSample::Receive(), sooner: it has one reader, and leaves out bytes that the reader's answer does
// not depend on. A flag ends the frame before it, so the intact frames beyond the flags around the damaged one are read
// as they were sent. So is the frame behind one with a length in front, when it ends where the receiver expects it.
class FrameReceiver {
 public:
  explicit FrameReceiver(const FrameSample& sample);
  Received Receive(std::span<const std::uint8_t> damaged);

 private:
  // Returns whether a reading has all bytes so far, so that the next byte is read like the first one.
  bool Feed(std::span<const std::uint8_t> bytes, Received& received);

  const FrameSample& sample_;
  std::unique_ptr<link::FrameReader> reader_;
  std::optional<std::uint8_t> flag_;
  std::uint64_t fed_count_ = 0;
};

}  // namespace tiltproof::harness
