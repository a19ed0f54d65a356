// FNV-1a, 64 bits (Fowler, Noll, Vo): for fingerprints of traces and payloads. Not cryptographic.
#pragma once

#include <cstdint>
#include <span>

namespace tiltproof::harness {

inline constexpr std::uint64_t kFnvOffset = 0xcbf29ce484222325ULL;

constexpr std::uint64_t Fnv1a(std::span<const std::uint8_t> bytes, std::uint64_t hash = kFnvOffset) {
  for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * 0x100000001b3ULL;
  return hash;
}

}  // namespace tiltproof::harness
