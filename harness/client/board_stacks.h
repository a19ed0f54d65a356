// The stacks of an image in lockstep: watched from the first instruction on, and measured when the flight is over.
//
//   BoardStacks stacks(symbols);
//   stacks.Watch(board);                         // before the first turn
//   log(stacks.OverflowText(event, source));     // of a lockstep::EventKind::kStackOverflow
//   for (const StackUse& stack : stacks.ReadOnce(board)) ...
#pragma once

#include <set>
#include <string>
#include <vector>

#include "harness/client/client.h"
#include "harness/emulator/diagnosis/source_lines.h"
#include "harness/emulator/emulator_process.h"
#include "harness/emulator/image_stacks.h"

namespace tiltproof::harness {

class BoardStacks {
 public:
  explicit BoardStacks(const ElfSymbols& symbols) : stacks_(StacksOf(symbols)) {}

  void Watch(EmulatorProcess& board) const;
  // "stack 'control_stack' (3072 bytes) overflowed: ..."
  std::string OverflowText(const lockstep::Event& event, const SourceLines& source);
  // Lists the stacks that the stack pointer has entered: once, before anything changes them. Empty when the emulator is gone.
  std::vector<StackUse> ReadOnce(EmulatorProcess& board);

 private:
  std::vector<ImageStack> stacks_;
  std::set<std::size_t> overflowed_;
  bool read_ = false;
};

}  // namespace tiltproof::harness
