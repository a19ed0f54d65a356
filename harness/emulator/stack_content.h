// Use of a stack by its content, for the harness and for the plug-in.
//
//   const std::uint32_t used_bytes = UsedBytes(content, lowest_pointer - begin);
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

namespace tiltproof::harness {

// Bytes at the high end of a stack that have been used. `content`: of the whole stack. Its lowest words hold what it was
// filled with before (0, or four equal bytes as RTOSes paint), and the first other word has been written.
// `lowest_offset`: of the lowest stack pointer, which may have reserved more than was written.
inline std::uint32_t UsedBytes(std::span<const std::uint8_t> content, std::uint32_t lowest_offset) {
  const auto size_bytes = static_cast<std::uint32_t>(content.size());
  const auto word_at = [&](std::uint32_t offset) {
    std::uint32_t word = 0;
    std::memcpy(&word, content.data() + offset, sizeof word);
    return word;
  };
  const auto is_fill = [](std::uint32_t word) { return word == (word & 0xFFU) * 0x0101'0101U; };
  // CMSIS-RTOS RTX writes it into the lowest word of each stack.
  constexpr std::uint32_t kRtxMagic = 0xE25A'2EA5;
  std::uint32_t written = 0;
  if (size_bytes >= 8 && word_at(0) == kRtxMagic) written = 4;
  if (size_bytes >= written + 4 && is_fill(word_at(written))) {
    const std::uint32_t fill = word_at(written);
    while (written + 4 <= size_bytes && word_at(written) == fill) written += 4;
  } else {
    written = 0;
  }
  return size_bytes - std::min(written, std::min(lowest_offset, size_bytes));
}

}  // namespace tiltproof::harness
