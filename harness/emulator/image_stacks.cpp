#include "harness/emulator/image_stacks.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <string_view>

#include "harness/emulator/lockstep_protocol.h"

namespace tiltproof::harness {
namespace {

// CMSIS-RTOS RTX writes it into the lowest word of each stack.
constexpr std::uint32_t kRtxMagic = 0xE25A'2EA5;

bool IsFill(std::uint32_t word) { return word == (word & 0xFFU) * 0x0101'0101U; }

bool NamesStack(std::string_view name) {
  constexpr std::string_view kStack = "stack";
  const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
  return std::search(name.begin(), name.end(), kStack.begin(), kStack.end(), same) != name.end();
}

bool Overlap(const MemoryRegion& a, const MemoryRegion& b) {
  return a.address < b.address + b.size_bytes && b.address < a.address + a.size_bytes;
}

}  // namespace

std::vector<ImageStack> StacksOf(const ElfSymbols& symbols) {
  std::vector<ImageStack> stacks;
  if (const auto main = symbols.MainStack()) stacks.push_back({"main", *main});
  for (const auto& [name, region] : symbols.Variables()) {
    if (!NamesStack(name) || stacks.size() == lockstep::kWatchedStacksMax) continue;
    // Whole words of it.
    const std::uint32_t begin = (region.address + 3) & ~3U, end = (region.address + region.size_bytes) & ~3U;
    if (end <= begin) continue;
    const MemoryRegion words{begin, end - begin};
    const auto overlaps = [&](const ImageStack& other) { return Overlap(other.region, words); };
    if (std::ranges::none_of(stacks, overlaps)) stacks.push_back({name, words});
  }
  return stacks;
}

std::uint32_t UsedBytes(std::span<const std::uint8_t> content, std::uint32_t lowest_offset) {
  const auto size_bytes = static_cast<std::uint32_t>(content.size());
  const auto word_at = [&](std::uint32_t offset) {
    std::uint32_t word = 0;
    std::memcpy(&word, content.data() + offset, sizeof word);
    return word;
  };
  std::uint32_t written = 0;
  if (size_bytes >= 8 && word_at(0) == kRtxMagic) written = 4;
  if (size_bytes >= written + 4 && IsFill(word_at(written))) {
    const std::uint32_t fill = word_at(written);
    while (written + 4 <= size_bytes && word_at(written) == fill) written += 4;
  } else {
    written = 0;
  }
  return size_bytes - std::min(written, std::min(lowest_offset, size_bytes));
}

}  // namespace tiltproof::harness
