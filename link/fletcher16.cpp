#include "link/fletcher16.h"

#include <cstddef>
#include <limits>

namespace tiltproof::link {
namespace {

// The modulo is put off to the end of a block: a division a byte costs seven times as much. Of n bytes FF,
// after sums that were reduced before, sum1 is at most 254 + 255 n and sum2 at most 254 + 254 n + 255 n (n +
// 1) / 2; this is the largest n for which both fit 32 bits.
constexpr std::uint64_t Sum2Max(std::uint64_t n) { return 254 + 254 * n + 255 * n * (n + 1) / 2; }
constexpr std::size_t kBlockBytes = 5802;
static_assert(Sum2Max(kBlockBytes) <= std::numeric_limits<std::uint32_t>::max());
static_assert(Sum2Max(kBlockBytes + 1) > std::numeric_limits<std::uint32_t>::max());

}  // namespace

std::uint16_t Fletcher16(std::span<const std::uint8_t> bytes) {
  std::uint32_t sum1 = 0;
  std::uint32_t sum2 = 0;
  while (!bytes.empty()) {
    const std::size_t count = bytes.size() < kBlockBytes ? bytes.size() : kBlockBytes;
    for (const std::uint8_t byte : bytes.first(count)) {
      sum1 += byte;
      sum2 += sum1;
    }
    sum1 %= kFletcherModulus;
    sum2 %= kFletcherModulus;
    bytes = bytes.subspan(count);
  }
  return static_cast<std::uint16_t>(sum2 << 8 | sum1);
}

}  // namespace tiltproof::link
