// A board in a QEMU that runs by the clock on the wall, stopped and looked at through QEMU's debugger port.
//
//   GdbBoard stopped(socket, usarts);            // stops it; it stays stopped
//   stopped.Registers();
//
// Each call waits for its answer. Together they may take that long; then EmulatorTrouble is thrown.
#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <optional>
#include <string>

#include "harness/emulator/diagnosis/stopped_board.h"
#include "harness/emulator/gdb_client.h"

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
  struct Reply {
    std::string packet, output;
  };
  Reply Ask(const std::string& packet);
  Reply Await();

  boost::asio::io_context loop_;
  lockstep::UsartStates usarts_;
  std::chrono::steady_clock::time_point until_;
  std::string lost_;
  std::optional<Reply> reply_;
  GdbClient gdb_;
};

}  // namespace tiltproof::harness
