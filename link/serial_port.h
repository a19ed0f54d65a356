// A serial port (or any other descriptor of bytes both ways) in an event loop: 8N1, raw, exclusive, no flow
// control. For firmware on a board, for both ends of a pseudo-terminal (link/pty.h), and for an emulator's port behind
// a unix socket (link/unix_socket.h).
//
//   boost::asio::io_context loop;
//   SerialPort port(loop, "/dev/ttyUSB0", 921'600);
//   port.Start([&](std::span<const std::uint8_t> bytes) { decoder.Feed(bytes); },
//              [&](const std::string& reason) { Lost(reason); });   // unplugged, hung up, ...
//   port.Write(frame);
//   loop.run();
//
// All calls come from the thread that runs the loop; the callbacks are called by the loop, never from within
// a call of ours, and may destroy the port. The loop must outlive it. Nothing here blocks.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "link/byte_line.h"

namespace boost::asio {
class io_context;
}

namespace tiltproof::link {

class SerialPort final : public ByteLine {
 public:
  static constexpr std::int64_t kBaudMin = 50;
  static constexpr std::int64_t kBaudMax = 20'000'000;

  // Opens a serial device, or the slave side of a pseudo-terminal: what had arrived before is discarded, as it
  // would be by a UART that nobody reads. Or connects to a socket, `unix:PATH` or `unix:@NAME`, which keeps every
  // byte and knows no baud rate. Throws std::runtime_error that says what is wrong (no such device, held by another
  // process, no permission, not a serial device, a baud rate it cannot do, nobody listens) and what to do about it.
  SerialPort(boost::asio::io_context& loop, const std::string& device, std::int64_t baud);

  // Takes over an open descriptor (read and write) as it is; `name` stands for it in messages.
  SerialPort(boost::asio::io_context& loop, int descriptor, std::string name);

  // Closes. Bytes of Write() that have not left yet are dropped (see UnsentBytes()): a device that takes none
  // would hold a close up for half a minute.
  ~SerialPort() override;

  // It is closed when the device was unplugged, the other end of the pseudo-terminal or socket is gone, or I/O
  // fails.
  void Start(Received received, Closed closed) override;
  bool Write(std::span<const std::uint8_t> bytes) override;

  // Bytes of Write() that have not left this machine yet, as far as the device tells; 0 once it is closed.
  std::size_t UnsentBytes() const;

  bool IsOpen() const;

  // Whether a byte takes its time at the baud rate. On a pseudo-terminal or a socket it takes none.
  bool TakesByteTime() const;

  // Who is at the other end of a socket of ours: a process of this machine; nullopt when nobody can tell.
  std::optional<pid_t> PeerProcess() const;

  // What the operating system agreed to.
  struct LowLatency {
    bool driver = false;                  // ASYNC_LOW_LATENCY: bytes are handed over at once
    std::optional<int> latency_timer_ms;  // of an FTDI adapter, now; nullopt for other devices
    std::string advice;                   // empty when nothing is left to do
  };
  // Asks the driver and the adapter to hand received bytes over at once; never fails, says what was achieved.
  LowLatency SetLowLatency(const std::filesystem::path& root = "/");

 private:
  class State;
  std::shared_ptr<State> state_;
};

}  // namespace tiltproof::link
