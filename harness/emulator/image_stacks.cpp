#include "harness/emulator/image_stacks.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "harness/emulator/lockstep_protocol.h"

namespace tiltproof::harness {
namespace {

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

}  // namespace tiltproof::harness
