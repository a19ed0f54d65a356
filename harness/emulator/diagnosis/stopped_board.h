// An emulated board that stands still, to be looked at: its registers and memory, and one instruction at a time.
//
//   StoppedInLockstep stopped(board, now_ns);    // of harness/emulator/emulator_process.h
//   stopped.Registers();                         // what harness/emulator/diagnosis/post_mortem.h asks for
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "harness/emulator/emulator_process.h"
#include "harness/emulator/lockstep_protocol.h"

namespace tiltproof::harness {

class StoppedBoard {
 public:
  virtual ~StoppedBoard() = default;
  // QEMU's dump (harness/emulator/diagnosis/cpu_state.h).
  virtual std::string Registers() = 0;
  // As the processor sees it, with its own peripherals. Fewer bytes, or none, where they cannot be read.
  virtual std::vector<std::uint8_t> ReadMemory(std::uint32_t address, std::uint32_t size) = 0;
  // Nullopt when their registers cannot be read.
  virtual std::optional<lockstep::UsartStates> UsartStates() = 0;
  // Executes one instruction; false when it cannot.
  virtual bool Step() = 0;
  // Over what is in flash, too: nothing goes on after that.
  virtual void WriteCode(std::uint32_t address, std::uint32_t word) = 0;
};

class StoppedInLockstep final : public StoppedBoard {
 public:
  // Both must outlive this. `now_ns`: virtual time.
  StoppedInLockstep(EmulatorProcess& board, std::int64_t now_ns) : board_(board), now_ns_(now_ns) {}
  std::string Registers() override { return board_.Registers(); }
  std::vector<std::uint8_t> ReadMemory(std::uint32_t address, std::uint32_t size) override {
    return board_.ReadMemory(address, size);
  }
  std::optional<lockstep::UsartStates> UsartStates() override { return board_.UsartStates(); }
  bool Step() override;
  void WriteCode(std::uint32_t address, std::uint32_t word) override {
    board_.Send(lockstep::Kind::kWriteCode, lockstep::WriteCode{address, word});
  }

 private:
  EmulatorProcess& board_;
  std::int64_t now_ns_;
};

// A board whose emulator has ended because the processor locked up: what the plug-in has kept of it.
class LockedUpBoard final : public StoppedBoard {
 public:
  LockedUpBoard(std::string registers, const lockstep::LastWords& words);
  std::string Registers() override { return registers_; }
  // The fault registers, and the stack from the stack pointer on.
  std::vector<std::uint8_t> ReadMemory(std::uint32_t address, std::uint32_t size) override;
  std::optional<lockstep::UsartStates> UsartStates() override { return std::nullopt; }
  bool Step() override { return false; }
  void WriteCode(std::uint32_t, std::uint32_t) override {}

 private:
  std::string registers_;
  lockstep::LastWords words_;
  std::uint32_t stack_ = 0;
};

}  // namespace tiltproof::harness
