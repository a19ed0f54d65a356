#include "harness/emulator/diagnosis/unmodelled_blocks.h"

#include <fmt/format.h>

#include "harness/emulator/stm32f405.h"

namespace tiltproof::harness {

std::optional<UnmodelledBlocks::Block> UnmodelledBlocks::Take(const Access& access,
                                                              const SourceLines& source) {
  const Peripheral* const peripheral = FindPeripheral(access.address);
  Block block{peripheral == nullptr ? fmt::format("0x{:08x}", access.address) : std::string(peripheral->name),
              {}};
  if (!names_.insert(block.name).second) return std::nullopt;
  block.text =
      fmt::format("{}, which the emulated board does not model{}: first {} at 0x{:08x}{} by {}",
                  peripheral == nullptr ? "an address without a block" : block.name,
                  peripheral != nullptr && !peripheral->on_chip ? " and an STM32F405 does not have" : "",
                  access.is_write ? "written" : "read", access.address,
                  peripheral == nullptr ? "" : fmt::format(" ({})", RegisterName(access.address)),
                  source.Describe(access.pc));
  return block;
}

}  // namespace tiltproof::harness
