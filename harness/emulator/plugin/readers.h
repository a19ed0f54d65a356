// Instructions that read registers, remembered so that they may do so in the middle of a block.
//
// QEMU counts the instructions of a block when it begins. A register's value may depend on the time, and so QEMU
// executes an instruction that reads one as a block of its own each time, which it finds out only when it is at the
// register: that is the largest part of what polling costs. An instruction that has read a register once will do so
// again. For as long as it reads, the count is set right instead: the instructions after it in the block are taken back.
//
//   readers.Init(cpu);
//   readers.Mark(block);   // when a block is translated
//   readers.OnRead();      // in a register's function
//   if (readers.Renew()) ...  // between two turns: what is already translated
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <set>
#include <utility>

#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/qemu_internals.h"

namespace tiltproof::qemu {

class Readers {
 public:
  void Init(void* cpu) { cpu_ = static_cast<std::uint8_t*>(cpu); }

  // Registers are about to be read, or written. Not stores: one may raise an interrupt, which comes after it and not
  // after its block.
  void OnRead() {
    if (alone_ != kNone) grown_ = known_.insert(alone_).second || grown_;
    alone_ = kNone;
  }
  void OnWrite() { alone_ = kNone; }

  void Mark(qemu_plugin_tb* block) {
    if (cpu_ == nullptr) return;
    const std::size_t count = qemu_plugin_tb_n_insns(block);
    alone_ = count == 1 ? qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(block, 0)) : kNone;
    for (std::size_t i = 0; i < count; ++i) {
      qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
      if (!known_.contains(qemu_plugin_insn_vaddr(instruction))) continue;
      const auto left = reinterpret_cast<void*>(count - 1 - i);
      qemu_plugin_register_vcpu_insn_exec_cb(instruction, Before, 0, left);
      if (i + 1 < count)
        qemu_plugin_register_vcpu_insn_exec_cb(qemu_plugin_tb_get_insn(block, i + 1), After, 0, left);
    }
  }

  // True if the processor's thread has work to do for it, before anything else.
  bool Renew() {
    if (grown_) tb_flush(cpu_);
    return std::exchange(grown_, false);
  }

 private:
  static constexpr std::uint64_t kNone = ~std::uint64_t{0};

  template <class T>
  T Get(std::size_t offset) const {
    T value;
    std::memcpy(&value, cpu_ + offset, sizeof(value));
    return value;
  }
  template <class T>
  void Set(std::size_t offset, T value) {
    std::memcpy(cpu_ + offset, &value, sizeof(value));
  }
  void RemoveLast(std::uint16_t count) {
    Set(kCountLeftOffset, static_cast<std::uint16_t>(Get<std::uint16_t>(kCountLeftOffset) + count));
  }

  static void Before(unsigned vcpu, void* left);
  static void After(unsigned vcpu, void* left);

  std::uint8_t* cpu_ = nullptr;
  std::set<std::uint64_t> known_;  // by address
  std::uint64_t alone_ = kNone;    // the address of the instruction that was translated last, by itself
  bool grown_ = false;
  bool tested_ = false;
};

inline Readers& readers = *new Readers;

inline void Readers::Before(unsigned /*vcpu*/, void* left) {
  readers.alone_ = kNone;
  const auto count = static_cast<std::uint16_t>(reinterpret_cast<std::uintptr_t>(left));
  if (!readers.tested_ && count > 0) {
    constexpr std::int64_t kInstructionNs = 8;
    if (readers.Get<std::uint32_t>(kCanDoIoOffset) != 0)
      Die("the processor's state is not where it should be: another build of QEMU 7.2?");
    readers.Set<std::uint32_t>(kCanDoIoOffset, 1);
    const std::int64_t before = qemu_clock_get_ns(kClockVirtual);
    readers.RemoveLast(count);
    if (qemu_clock_get_ns(kClockVirtual) != before - kInstructionNs * count)
      Die("the count of instructions is not where it should be: another build of QEMU 7.2?");
    readers.tested_ = true;
    return;
  }
  readers.Set<std::uint32_t>(kCanDoIoOffset, 1);
  readers.RemoveLast(count);
}

inline void Readers::After(unsigned /*vcpu*/, void* left) {
  readers.Set<std::uint32_t>(kCanDoIoOffset, 0);
  readers.RemoveLast(static_cast<std::uint16_t>(-static_cast<int>(reinterpret_cast<std::uintptr_t>(left))));
}

}  // namespace tiltproof::qemu
