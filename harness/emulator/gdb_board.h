// A board in a QEMU that runs by the clock on the wall, stopped and looked at through QEMU's debugger port (GDB Remote
// Serial Protocol, appendix E of the GDB manual).
//
//   GdbBoard stopped(socket, usarts);            // stops it; it stays stopped
//   stopped.Registers();
//
// Each call waits for its answer. Together they may take that long; then EmulatorTrouble is thrown.
#pragma once

#include <chrono>
#include <string>

#include "harness/emulator/stopped_board.h"

namespace tiltproof::harness {

class GdbBoard final : public StoppedBoard {
 public:
  static constexpr std::chrono::seconds kLimit{3};

  // `socket`: connected, and used by no one else meanwhile. `usarts`: as the plug-in has counted.
  GdbBoard(int socket, const lockstep::UsartStates& usarts, std::chrono::milliseconds limit = kLimit);

  std::string Registers() override;
  std::vector<std::uint8_t> ReadMemory(std::uint32_t address, std::uint32_t size) override;
  std::optional<lockstep::UsartStates> UsartStates() override { return usarts_; }
  bool Step() override;
  void WriteCode(std::uint32_t address, std::uint32_t word) override;

 private:
  std::string Ask(const std::string& packet);
  std::string NextPacket();
  char NextByte();
  void Write(const std::string& bytes);

  int socket_;
  lockstep::UsartStates usarts_;
  std::chrono::steady_clock::time_point until_;
  std::string in_;
  std::size_t taken_ = 0;
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
