// Flips bits in the memory of an emulated board while it runs, through QEMU's debugger port (GDB Remote
// Serial Protocol, appendix E of the GDB manual). The board and its clock are stopped while this happens.
//
//   GdbClient debugger(loop, socket, on_lost);
//   debugger.Flip({{0x2000'0100, 3}}, [](const std::string& error, const std::vector<FlippedByte>& flipped) { ... });
//
// Nothing blocks, and nothing is timed here: the owner checks Waiting() periodically.
#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "link/serial_port.h"

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

class GdbClient {
 public:
  // `error` is empty when all bits were flipped; `flipped`: those that were.
  using Done = std::function<void(const std::string& error, const std::vector<FlippedByte>& flipped)>;
  using Lost = std::function<void(const std::string& why)>;

  // Takes over a connected socket. The loop calls the callbacks, and they may destroy this object.
  GdbClient(boost::asio::io_context& loop, int socket, Lost lost);
  GdbClient(const GdbClient&) = delete;
  GdbClient& operator=(const GdbClient&) = delete;

  // Flips all at one instant of the board's time, after the earlier requests. A board that was stopped stays
  // stopped.
  void Flip(std::vector<MemoryBit> bits, Done done);

  // The time for which the oldest request has been waiting for its answer; zero when none is.
  std::chrono::nanoseconds Waiting() const;

 private:
  struct Job {
    std::vector<MemoryBit> bits;
    Done done;
  };
  enum class Step : std::uint8_t { kIdle, kStop, kRead, kWrite, kContinue };

  void Begin();
  void Ask(Step step, const std::string& packet);
  void AskNextBit();
  void OnBytes(std::span<const std::uint8_t> bytes);
  void OnAcknowledged();
  void OnPacket(const std::string& packet);
  void Finish();
  void Lose(const std::string& why);

  link::SerialPort port_;
  Lost lost_callback_;
  std::deque<Job> jobs_;
  Step step_ = Step::kIdle;
  bool acknowledged_ = false;  // the request is acknowledged; the next packet is its answer
  bool was_running_ = false;
  std::vector<FlippedByte> flipped_;
  std::string error_;
  std::optional<std::string> packet_;  // being received, from its $ on
  int checksum_digits_left_ = 0;
  std::optional<std::chrono::steady_clock::time_point> asked_at_;
  bool lost_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::harness
