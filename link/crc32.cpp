#include "link/crc32.h"

#include <array>
#include <cstddef>

namespace tiltproof::link {
namespace {

constexpr std::uint32_t kReversedPolynomial = 0xEDB8'8320;

// The remainders of four bits. A table for eight takes 1 KB of flash; a frame is too short for that to pay.
constexpr std::array<std::uint32_t, 16> kRemainders = [] {
  std::array<std::uint32_t, 16> remainders{};
  for (std::uint32_t i = 0; i < remainders.size(); ++i) {
    std::uint32_t rest = i;
    for (int bit = 0; bit < 4; ++bit) rest = rest >> 1 ^ ((rest & 1) != 0 ? kReversedPolynomial : 0);
    remainders[i] = rest;
  }
  return remainders;
}();

}  // namespace

std::uint32_t Crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t rest = 0xFFFF'FFFF;
  for (const std::uint8_t byte : bytes) {
    rest ^= byte;
    rest = rest >> 4 ^ kRemainders[rest & 15];
    rest = rest >> 4 ^ kRemainders[rest & 15];
  }
  return ~rest;
}

}  // namespace tiltproof::link
