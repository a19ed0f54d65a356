#include "harness/integrity/check_group.h"

#include "link/check.h"

namespace tiltproof::harness {
namespace {

using link::CheckKind;

constexpr std::uint32_t kFletcherModulus = 255;

bool IsCrc(CheckKind kind) {
  return kind == CheckKind::kCrc16Ibm3740 || kind == CheckKind::kCrc16IbmSdlc ||
         kind == CheckKind::kCrc32IsoHdlc;
}

std::uint32_t ModulusOf(CheckKind kind) {
  return kind == CheckKind::kFletcher16 ? kFletcherModulus : kind == CheckKind::kSum8 ? 256 : 1;
}

// The bits in which check and payload differ when one bit of a content of zeros changes, apart from the check of zeros.
std::uint32_t SyndromeOf(CheckKind kind, std::vector<std::uint8_t>& zeros, std::size_t place,
                         std::uint8_t bits, std::size_t payload_bytes, std::uint32_t of_zeros) {
  zeros[place] = bits;
  const std::span<const std::uint8_t> content(zeros);
  const std::uint32_t syndrome = link::Checksum(kind, content.first(payload_bytes)) ^ of_zeros ^
                                 link::LoadCheck(kind, content.subspan(payload_bytes));
  zeros[place] = 0;
  return syndrome;
}

}  // namespace

CheckGroup::CheckGroup(CheckKind kind, std::size_t content_bytes)
    : kind_(kind),
      is_linear_(IsCrc(kind)),
      modulus_(ModulusOf(kind)),
      check_bytes_(link::CheckBytes(kind)),
      payload_bytes_(content_bytes - check_bytes_) {
  if (!is_linear_) return;
  std::vector<std::uint8_t> zeros(content_bytes);
  const std::uint32_t of_zeros = link::Checksum(kind, std::span(zeros).first(payload_bytes_));
  syndromes_.resize(content_bytes);
  for (std::size_t place = 0; place < content_bytes; ++place) {
    auto& of_place = syndromes_[place];
    for (std::size_t bits = 1; bits < 256; ++bits) {
      const std::size_t lowest = bits & (~bits + 1);
      of_place[bits] = bits == lowest ? SyndromeOf(kind, zeros, place, static_cast<std::uint8_t>(bits),
                                                   payload_bytes_, of_zeros)
                                      : of_place[lowest] ^ of_place[bits ^ lowest];
    }
  }
  std::vector<std::uint8_t> longer(payload_bytes_ + 1);
  for (std::size_t byte = 0; byte < in_front_.size(); ++byte) {
    longer[0] = static_cast<std::uint8_t>(byte);
    in_front_[byte] = link::Checksum(kind, longer) ^ of_zeros;
  }
}

std::uint64_t CheckGroup::Change(std::size_t place, std::uint8_t from, std::uint8_t to) const {
  if (is_linear_) return syndromes_[place][from ^ to];
  const std::uint64_t change = (to + 2 * modulus_ * 256 - from) % modulus_;
  const std::uint64_t back = (modulus_ - change) % modulus_;
  if (kind_ == CheckKind::kFletcher16) {
    if (place == payload_bytes_) return back;
    if (place == payload_bytes_ + 1) return back << kSumBits;
    return change | change * (payload_bytes_ - place) % modulus_ << kSumBits;
  }
  return place < payload_bytes_ ? change : back;
}

std::uint64_t CheckGroup::InFront(std::uint8_t byte) const {
  if (is_linear_) return in_front_[byte];
  const std::uint64_t sum = byte % modulus_;
  return kind_ == CheckKind::kFletcher16 ? sum | sum * (payload_bytes_ + 1) % modulus_ << kSumBits : sum;
}

std::uint64_t CheckGroup::Of(std::span<const std::uint8_t> content) const {
  Check(content.size() == content_bytes(), "a group is that of a content of one length");
  const auto payload = content.first(payload_bytes_), check = content.subspan(payload_bytes_);
  const std::uint32_t right = link::Checksum(kind_, payload);
  if (is_linear_) return right ^ link::LoadCheck(kind_, check);
  std::uint64_t effect = 0;
  for (std::size_t i = 0; i < check_bytes_; ++i)
    effect |= (link::CheckByte(kind_, right, i) + std::uint64_t{256} * modulus_ - check[i]) % modulus_
              << kSumBits * i;
  return effect;
}

std::uint64_t CheckGroup::Missing(std::uint64_t total) const {
  if (is_linear_) return total;
  const auto back = [&](std::uint64_t sum) { return (modulus_ - sum % modulus_) % modulus_; };
  return back(total & kSumMask) | back(total >> kSumBits) << kSumBits;
}

}  // namespace tiltproof::harness
