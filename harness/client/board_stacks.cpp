#include "harness/client/board_stacks.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <utility>

#include "harness/emulator/stack_content.h"

namespace tiltproof::harness {

void BoardStacks::Watch(EmulatorProcess& board) const {
  std::vector<lockstep::WatchedStack> watched;
  for (const auto& [name, region] : stacks_)
    watched.push_back({region.address, region.address + region.size_bytes});
  board.Send(lockstep::Kind::kWatchStacks, std::span<const lockstep::WatchedStack>(watched));
}

std::string BoardStacks::OverflowText(const lockstep::Event& event, const SourceLines& source) {
  const ImageStack& stack = stacks_.at(event.before);
  overflowed_.insert(event.before);
  return fmt::format("stack '{}' ({} bytes) overflowed: the stack pointer is {} bytes below it in {}",
                     stack.name, stack.region.size_bytes, stack.region.address - event.address,
                     source.Describe(event.value));
}

std::vector<StackUse> BoardStacks::ReadOnce(EmulatorProcess& board) {
  if (std::exchange(read_, true)) return {};
  std::vector<StackUse> uses;
  try {
    const std::vector<std::uint32_t> lowest = board.LowestStackAddresses();
    for (std::size_t i = 0; i < std::min(stacks_.size(), lowest.size()); ++i) {
      const auto& [name, region] = stacks_[i];
      if (lowest[i] == region.address + region.size_bytes) continue;
      const std::vector<std::uint8_t> content = board.ReadMemory(region.address, region.size_bytes);
      if (content.size() < region.size_bytes) continue;
      uses.push_back({.name = name,
                      .size_bytes = region.size_bytes,
                      .used_bytes_max = UsedBytes(content, lowest[i] - region.address),
                      .overflowed = overflowed_.contains(i)});
    }
  } catch (const EmulatorTrouble&) {
    return {};  // the flight has been flown; only these figures are missing
  }
  return uses;
}

}  // namespace tiltproof::harness
