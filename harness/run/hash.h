// FNV-1a, 64 bits (Fowler, Noll, Vo): for fingerprints of traces and payloads. Not cryptographic.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>

namespace tiltproof::harness {

inline constexpr std::uint64_t kFnvOffset = 0xcbf29ce484222325ULL;
inline constexpr std::uint64_t kFnvPrime = 0x100000001b3ULL;

constexpr std::uint64_t Fnv1a(std::span<const std::uint8_t> bytes, std::uint64_t hash = kFnvOffset) {
  for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * kFnvPrime;
  return hash;
}

// Hash of the word's eight bytes, the lowest first. Numbers of few digits begin with zeros, which only multiply: a
// run of them is one multiplication.
constexpr std::uint64_t Fnv1a(std::uint64_t word, std::uint64_t hash) {
  constexpr auto kPowers = [] {
    std::array<std::uint64_t, 9> powers{1};
    for (std::size_t i = 1; i < powers.size(); ++i) powers[i] = powers[i - 1] * kFnvPrime;
    return powers;
  }();
  const auto zeros = static_cast<std::size_t>(std::countr_zero(word)) / 8;
  hash *= kPowers[zeros];
  for (std::size_t i = zeros; i < 8; ++i) hash = (hash ^ (word >> (8 * i) & 0xff)) * kFnvPrime;
  return hash;
}

}  // namespace tiltproof::harness
