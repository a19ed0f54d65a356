// The lowest stack pointer in each stack of the image, and the moment at which a stack is left at its lower end.
//
//   stack_watch.Init(cpu);
//   stack_watch.Mark(block);         // when a block is translated
//   stack_watch.Watch(stacks);       // before the first turn
//   stack_watch.Look();              // before a reset: what the firmware clears when it starts
//   stack_watch.Lowest();            // between two turns
//
// QEMU holds the stack pointer in the processor's state only where a block begins. How far a block lowers it from there follows
// from its code, so that only blocks which lower it cost anything: one call each. What an exception or an RTOS stores
// below the stack pointer of a task in other ways is found in the stack's content, here before a reset and by the harness at the end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/plugin_state.h"
#include "harness/emulator/plugin/processor.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/stack_change.h"
#include "harness/emulator/stack_content.h"

namespace tiltproof::qemu {

class StackWatch {
 public:
  void Init(void* cpu) {
    cpu_ = static_cast<std::uint8_t*>(cpu);
    if (StackPointer() != RegisterIn(DumpState(cpu), "R13"))
      Die("the processor's registers are not where they should be: another build of QEMU 7.2?");
  }

  void Watch(const std::vector<WatchedStack>& stacks) {
    stacks_.clear();
    for (const WatchedStack& stack : stacks) stacks_.push_back({stack.begin, stack.end, stack.end, false});
    current_ = 0;
  }

  // Takes in what was written to the stacks that were in use.
  void Look() {
    for (Stack& stack : stacks_) {
      if (stack.lowest == stack.end) continue;
      std::vector<std::uint8_t> content(stack.end - stack.begin);
      ReadAsProcessor(cpu_, stack.begin, content.data(), content.size());
      stack.lowest = stack.end - harness::UsedBytes(content, stack.lowest - stack.begin);
    }
  }

  std::vector<std::uint32_t> Lowest() const {
    std::vector<std::uint32_t> lowest;
    for (const Stack& stack : stacks_) lowest.push_back(stack.lowest);
    return lowest;
  }

  void Mark(qemu_plugin_tb* block) {
    std::int32_t change = 0, lowest = 0;
    for (std::size_t i = 0; i < qemu_plugin_tb_n_insns(block); ++i) {
      const qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
      std::uint16_t code[2] = {0, 0};
      std::memcpy(code, qemu_plugin_insn_data(instruction), qemu_plugin_insn_size(instruction));
      const auto moved = StackChange(code[0], code[1]);
      if (!moved) break;  // the next block begins with what it has become
      lowest = std::min(lowest, change += *moved);
    }
    MarkSave(block);
    if (lowest == 0) return;
    const std::uint64_t pc = qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(block, 0));
    qemu_plugin_register_vcpu_tb_exec_cb(
        block, OnBlock, 0, reinterpret_cast<void*>(pc << 32U | static_cast<std::uint32_t>(-lowest)));
  }

 private:
  // A handler that switches tasks stores the task's registers by a register that holds its stack pointer (FreeRTOS, RTX):
  // stmdb r0!, {r4-r11}, and vstmdb r0!, {s16-s31} for a task with floating-point registers.
  void MarkSave(qemu_plugin_tb* block) {
    std::uint32_t base = kNoRegister, bytes = 0, float_bytes = 0;
    for (std::size_t i = 0; i < qemu_plugin_tb_n_insns(block); ++i) {
      const qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
      std::uint16_t code[2] = {0, 0};
      std::memcpy(code, qemu_plugin_insn_data(instruction), qemu_plugin_insn_size(instruction));
      const auto saved = SavedBelow(code[0], code[1]);
      // Where a block begins, the register does not hold yet what it reads later in the block.
      if ((code[0] & 0xFFE0U) == 0xF3E0 && base == kNoRegister) return;
      if (!saved || (base != kNoRegister && saved->base != base)) continue;
      base = saved->base;
      (saved->is_float ? float_bytes : bytes) += saved->bytes;
    }
    if (base == kNoRegister) return;
    const std::uint64_t pc = qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(block, 0));
    qemu_plugin_register_vcpu_tb_exec_cb(
        block, OnSave, 0, reinterpret_cast<void*>(pc << 32U | base << 24U | float_bytes << 12U | bytes));
  }

  static constexpr std::uint32_t kNoRegister = 16;

  struct Stack {
    std::uint32_t begin, end;
    std::uint32_t lowest;  // not below `begin`
    bool overflowed;
    // At its end it is empty. At its begin it is full, and the stack that lies there may be empty.
    bool Holds(std::uint32_t pointer) const { return pointer - begin - 1 < end - begin; }
  };

  static void OnBlock(unsigned vcpu, void* pc_and_depth);
  static void OnSave(unsigned vcpu, void* what);

  std::uint32_t Register(std::size_t number) const {
    std::uint32_t value = 0;
    std::memcpy(&value, cpu_ + kRegistersOffset + number * sizeof(value), sizeof(value));
    return value;
  }
  std::uint32_t StackPointer() const { return Register(13); }

  // A block at `pc` begins with this stack pointer, and lowers it to `lowest`.
  void Note(std::uint32_t pointer, std::uint32_t lowest, std::uint32_t pc) {
    Stack* stack = &stacks_[current_];
    const bool is_full = pointer == stack->begin && stack->lowest == stack->begin;
    if (!is_full) {
      stack = std::find_if(stacks_.data(), stacks_.data() + stacks_.size(),
                           [&](const Stack& other) { return other.Holds(pointer); });
      if (stack == stacks_.data() + stacks_.size()) return;  // one that the image does not delimit
      current_ = static_cast<std::size_t>(stack - stacks_.data());
    }
    stack->lowest = std::min(stack->lowest, std::max(lowest, stack->begin));
    if (lowest >= stack->begin || stack->overflowed) return;
    stack->overflowed = true;
    // Virtual time may be read only between two instructions: here one begins.
    constexpr std::uint32_t kMayRead = 1;
    std::uint32_t before = 0;
    std::memcpy(&before, cpu_ + kCanDoIoOffset, sizeof(before));
    std::memcpy(cpu_ + kCanDoIoOffset, &kMayRead, sizeof(kMayRead));
    SendEvent(EventKind::kStackOverflow, pc, lowest, static_cast<std::uint8_t>(current_));
    std::memcpy(cpu_ + kCanDoIoOffset, &before, sizeof(before));
  }

  std::uint8_t* cpu_ = nullptr;
  std::vector<Stack> stacks_;
  std::size_t current_ = 0;  // the one that was used last
};

inline StackWatch& stack_watch = *new StackWatch;

inline void StackWatch::OnBlock(unsigned /*vcpu*/, void* pc_and_depth) {
  StackWatch& to = stack_watch;
  if (to.stacks_.empty()) return;
  const auto both = reinterpret_cast<std::uintptr_t>(pc_and_depth);
  const std::uint32_t pointer = to.StackPointer(), lowest = pointer - static_cast<std::uint32_t>(both);
  const Stack& stack = to.stacks_[to.current_];
  if (lowest >= stack.lowest && stack.Holds(pointer)) return;
  to.Note(pointer, lowest, static_cast<std::uint32_t>(both >> 32U));
}

inline void StackWatch::OnSave(unsigned /*vcpu*/, void* what) {
  StackWatch& to = stack_watch;
  // In a handler that returns to the process stack (ARMv7-M ARM, table B1-8).
  constexpr std::uint32_t kExceptionReturn = 0xFFFF'FFE0, kProcessStack = 1U << 2, kBasicFrame = 1U << 4;
  const std::uint32_t link = to.stacks_.empty() ? 0 : to.Register(14);
  if (link < kExceptionReturn || (link & kProcessStack) == 0) return;
  const auto all = reinterpret_cast<std::uintptr_t>(what);
  const std::uint32_t pointer = to.Register(all >> 24U & 15U);
  const auto saved = static_cast<std::uint32_t>(all);
  const std::uint32_t bytes = (saved & 0xFFFU) + ((link & kBasicFrame) != 0 ? 0 : saved >> 12U & 0xFFFU);
  to.Note(pointer, pointer - bytes, static_cast<std::uint32_t>(all >> 32U));
}

}  // namespace tiltproof::qemu
