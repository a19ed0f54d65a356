// A check as a group: the changes of single bytes of payload and check add up to zero, or the check does not hold. For a
// CRC they add up bit by bit without carry, whatever the data. For sums they add up modulo 255 or 256.
//
//   const CheckGroup group(link::CheckKind::kFletcher16, content.size());
//   std::uint64_t total = 0;
//   total = group.Add(total, group.Change(3, content[3], 0x12));
//   if (group.MayHold(total)) Receive();
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "link/checksum.h"

namespace tiltproof::harness {

class CheckGroup {
 public:
  // `content_bytes`: of payload and check.
  CheckGroup(link::CheckKind kind, std::size_t content_bytes);

  // The effect of a byte of the content that changes, on a check that holds. Its bits above kEffectBits are 0.
  static constexpr int kEffectBits = 48;
  std::uint64_t Change(std::size_t place, std::uint8_t from, std::uint8_t to) const;
  // The effect of a byte that comes in front of the content.
  std::uint64_t InFront(std::uint8_t byte) const;
  // The effect of these content_bytes() bytes, whatever they are: zero only if the check may hold.
  std::uint64_t Of(std::span<const std::uint8_t> content) const;
  // The effect of both. Up to 65,000 effects may be added to one another.
  std::uint64_t Add(std::uint64_t a, std::uint64_t b) const { return is_linear_ ? a ^ b : a + b; }
  // False only if the check is wrong after these changes. Fletcher's sums are equal to the check only modulo 255, so a
  // check byte FF in place of 00 may be wrong all the same.
  bool MayHold(std::uint64_t total) const {
    return is_linear_ ? total == 0
                      : (total & kSumMask) % modulus_ == 0 && (total >> kSumBits) % modulus_ == 0;
  }
  // The only effect of one byte with which the check may hold, after these changes.
  std::uint64_t Missing(std::uint64_t total) const;

  bool is_linear() const { return is_linear_; }
  std::uint32_t modulus() const { return modulus_; }
  std::size_t content_bytes() const { return payload_bytes_ + check_bytes_; }
  std::size_t payload_bytes() const { return payload_bytes_; }
  link::CheckKind kind() const { return kind_; }

 private:
  static constexpr int kSumBits = kEffectBits / 2;
  static constexpr std::uint64_t kSumMask = (std::uint64_t{1} << kSumBits) - 1;

  link::CheckKind kind_;
  bool is_linear_;
  std::uint32_t modulus_;  // of sums; 1: every change is zero
  std::size_t check_bytes_, payload_bytes_;
  std::vector<std::array<std::uint32_t, 256>>
      syndromes_;                              // of a CRC: by place, and by the bits that change there
  std::array<std::uint32_t, 256> in_front_{};  // of a CRC: by the byte in front
};

}  // namespace tiltproof::harness
