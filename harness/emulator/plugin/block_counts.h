// Counts the executions of each block of code, for a harness that wants to know (harness::lockstep::BlockCounts).
//
//   block_counts.Use(4);         // an inherited descriptor of the memory
//   block_counts.Mark(block);    // when a block is translated
//
// The emulator cuts a block wherever a timer is due or a register is read. The code after such a cut is the same block
// still. A count of its own would show the time of the cut, and not the firmware's work.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/qemu_internals.h"

namespace tiltproof::qemu {

class BlockCountsWriter {
 public:
  void Use(int descriptor) {
    void* memory = mmap(nullptr, sizeof(harness::lockstep::BlockCounts), PROT_READ | PROT_WRITE, MAP_SHARED,
                        descriptor, 0);
    if (memory == MAP_FAILED) Die("the memory for coverage cannot be mapped");
    counts_ = static_cast<harness::lockstep::BlockCounts*>(memory);
  }

  void Mark(qemu_plugin_tb* block) {
    if (counts_ == nullptr) return;
    const qemu_plugin_insn* last = qemu_plugin_tb_get_insn(block, qemu_plugin_tb_n_insns(block) - 1);
    const std::uint64_t end = qemu_plugin_insn_vaddr(last) + qemu_plugin_insn_size(last);
    const std::uint64_t place = PlaceOf(qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(block, 0)));
    const std::uint64_t next = Branches(last) ? kNoPlace : PlaceOf(end);
    qemu_plugin_register_vcpu_tb_exec_cb(block, OnBlock, 0, reinterpret_cast<void*>(next << 32U | place));
  }

 private:
  static constexpr std::uint32_t kNoPlace = 0xFFFFFFFF;

  static std::uint32_t PlaceOf(std::uint64_t address) {
    return harness::lockstep::BlockCounts::PlaceOf(static_cast<std::uint32_t>(address)).value_or(kNoPlace);
  }

  // True if a block ends with this instruction wherever it begins (ARMv7-M ARM, section A5).
  static bool Branches(const qemu_plugin_insn* instruction) {
    std::uint16_t code[2] = {0, 0};
    const std::size_t size = qemu_plugin_insn_size(instruction);
    std::memcpy(code, qemu_plugin_insn_data(instruction), size == 4 ? 4 : 2);
    const auto has = [&](unsigned mask, unsigned value) { return (code[0] & mask) == value; };
    if (size != 4)
      return has(0xF000, 0xD000) || has(0xF800, 0xE000) || has(0xFF00, 0x4700) || has(0xF500, 0xB100) ||
             has(0xFF00, 0xBD00) || has(0xFF87, 0x4687) || has(0xFF87, 0x4487);
    const bool loads_pc = (has(0xFFD0, 0xE890) || has(0xFFD0, 0xE910)) && (code[1] & 0x8000U) != 0;
    const bool register_is_pc = (has(0xFFF0, 0xF8D0) || has(0xFF70, 0xF850)) && (code[1] >> 12U) == 15;
    const bool by_table = has(0xFFF0, 0xE8D0) && (code[1] & 0xFFE0U) == 0xF000;
    return (has(0xF800, 0xF000) && (code[1] & 0x8000U) != 0) || loads_pc || register_is_pc || by_table;
  }

  static void OnBlock(unsigned vcpu, void* places);

  harness::lockstep::BlockCounts* counts_ = nullptr;
  std::uint32_t rest_ = kNoPlace;  // where the block that was cut goes on; an interrupt may come before that
};

inline BlockCountsWriter& block_counts = *new BlockCountsWriter;

inline void BlockCountsWriter::OnBlock(unsigned /*vcpu*/, void* places) {
  BlockCountsWriter& to = block_counts;
  const auto both = reinterpret_cast<std::uintptr_t>(places);
  const auto place = static_cast<std::uint32_t>(both);
  const auto next = static_cast<std::uint32_t>(both >> 32U);
  if (place == to.rest_) {
    to.rest_ = kNoPlace;
  } else if (place != kNoPlace && to.counts_->counts[place] != 255) {
    ++to.counts_->counts[place];
  }
  if (next != kNoPlace) to.rest_ = next;
}

}  // namespace tiltproof::qemu
