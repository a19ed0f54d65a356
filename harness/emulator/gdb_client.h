// The client of QEMU's debugger port (GDB Remote Serial Protocol, appendix E of the GDB manual): it stops the
// board, asks, and lets it run again.
//
//   GdbClient gdb(loop, socket, on_lost);
//   gdb.Stop([&](bool was_running) {
//     gdb.Ask("m20000100,1", [&](const std::string& packet, const std::string&) { bytes = HexBytes(packet); });
//   });
//
// Nothing blocks, and nothing is timed here: the owner checks Waiting() periodically.
#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "link/serial_port.h"

namespace tiltproof::harness {

// Bytes up to the first pair of characters that are no hexadecimal digits.
std::vector<std::uint8_t> HexBytes(std::string_view digits);
std::string HexDigits(std::string_view bytes);

// One request at a time: the next one comes from a callback, or after it.
class GdbClient {
 public:
  // `was_running`: the board ran until now.
  using Stopped = std::function<void(bool was_running)>;
  // `packet`: the answer without its frame; "" to a request that QEMU does not know. `output`: what QEMU printed
  // before it.
  using Answer = std::function<void(const std::string& packet, const std::string& output)>;
  using Lost = std::function<void(const std::string& why)>;

  // Takes over a connected socket. The loop calls the callbacks, and they may destroy this object.
  GdbClient(boost::asio::io_context& loop, int socket, Lost lost);
  GdbClient(const GdbClient&) = delete;
  GdbClient& operator=(const GdbClient&) = delete;

  // Stops the board and its clock.
  void Stop(Stopped stopped);
  // Only while the board is stopped.
  void Ask(const std::string& packet, Answer answer);
  // Lets the board run; `accepted`: QEMU has read the request.
  void Continue(std::function<void()> accepted);

  // The time for which the request has been waiting for its answer; zero when there is none.
  std::chrono::nanoseconds Waiting() const;

 private:
  void Request(const std::string& packet, Answer answer);
  void OnBytes(std::span<const std::uint8_t> bytes);
  void OnAcknowledged();
  void OnPacket(const std::string& packet);
  void Finish(const std::string& packet);
  void Lose(const std::string& why);

  link::SerialPort port_;
  Lost lost_callback_;
  Answer answer_;  // empty when nothing was asked
  bool ends_when_acknowledged_ = false;
  bool acknowledged_ = false;  // the request is; the next packet is its answer
  bool reported_stop_ = false;
  std::string output_;
  std::optional<std::string> packet_;  // being received, from its $ on
  int checksum_digits_left_ = 0;
  std::optional<std::chrono::steady_clock::time_point> asked_at_;
  bool lost_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::harness
