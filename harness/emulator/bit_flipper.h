// Flips bits in the memory of an emulated board while it runs, through QEMU's debugger port. The board and its
// clock are stopped while this happens.
//
//   BitFlipper flipper(loop, socket, on_lost);
//   flipper.Flip({{0x2000'0100, 3}}, [](const std::string& error, const std::vector<FlippedByte>& flipped) { ... });
//
// Nothing blocks, and nothing is timed here: the owner checks Waiting() periodically.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "harness/emulator/gdb_client.h"

namespace tiltproof::harness {

struct MemoryBit {
  std::uint32_t address = 0;
  int bit = 0;  // 0 to 7
};

struct FlippedByte {
  std::uint32_t address = 0;
  std::uint8_t before = 0, after = 0;
  friend bool operator==(const FlippedByte&, const FlippedByte&) = default;
};

class BitFlipper {
 public:
  // `error` is empty when all bits were flipped; `flipped`: those that were.
  using Done = std::function<void(const std::string& error, const std::vector<FlippedByte>& flipped)>;

  // Takes over a connected socket. The loop calls the callbacks, and they may destroy this object.
  BitFlipper(boost::asio::io_context& loop, int socket, GdbClient::Lost lost);

  // Flips all at one instant of the board's time, after the earlier requests. A board that was stopped stays
  // stopped.
  void Flip(std::vector<MemoryBit> bits, Done done);

  // The time for which QEMU has owed an answer.
  std::chrono::nanoseconds Waiting() const { return gdb_.Waiting(); }

 private:
  struct Job {
    std::vector<MemoryBit> bits;
    Done done;
  };

  void Begin();
  void FlipNext();
  void Write(const FlippedByte& byte);
  void Finish();

  GdbClient gdb_;
  std::deque<Job> jobs_;  // the first one is being done
  bool was_running_ = false;
  std::vector<FlippedByte> flipped_;
  std::string error_;
};

}  // namespace tiltproof::harness
