#include "harness/emulator/diagnosis/stopped_board.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "harness/emulator/diagnosis/cpu_state.h"
#include "harness/emulator/diagnosis/fault_registers.h"

namespace tiltproof::harness {

bool StoppedInLockstep::Step() {
  // QEMU runs with -icount shift=3.
  constexpr std::int64_t kInstructionNs = 8;
  const lockstep::Stopped stopped =
      board_.Run({now_ns_ + kInstructionNs, 0, 0, 0}, [](const EmulatorMessage&) {});
  now_ns_ = std::max(stopped.at_ns, now_ns_ + kInstructionNs);
  return !stopped.locked_up;
}

LockedUpBoard::LockedUpBoard(std::string registers, const lockstep::LastWords& words)
    : registers_(std::move(registers)), words_(words) {
  if (const auto state = ParseCpuState(registers_)) stack_ = state->stack_pointer();
}

std::vector<std::uint8_t> LockedUpBoard::ReadMemory(std::uint32_t address, std::uint32_t size) {
  const auto part = [&](const auto& words, std::uint32_t begin) {
    std::vector<std::uint8_t> bytes(sizeof words);
    std::memcpy(bytes.data(), words, sizeof words);
    bytes.erase(bytes.begin(), bytes.begin() + (address - begin));
    bytes.resize(std::min<std::size_t>(bytes.size(), size));
    return bytes;
  };
  if (address - kFaultRegisters < sizeof words_.faults) return part(words_.faults, kFaultRegisters);
  if (address - stack_ < sizeof words_.stack) return part(words_.stack, stack_);
  return {};
}

}  // namespace tiltproof::harness
