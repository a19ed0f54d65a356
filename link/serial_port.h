// A serial port (or any other terminal-like descriptor) in an event loop: 8N1, raw, exclusive, no flow
// control. For firmware on a board, and for both ends of a pseudo-terminal (link/pty.h).
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

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace boost::asio {
class io_context;
}

namespace tiltproof::link {

class SerialPort {
 public:
  // What Write() holds at most when the device takes bytes more slowly than they come: 11 s at 921600 baud.
  static constexpr std::size_t kQueueBytesMax = std::size_t{1} << 20;
  static constexpr std::int64_t kBaudMin = 50;
  static constexpr std::int64_t kBaudMax = 20'000'000;

  using Received = std::function<void(std::span<const std::uint8_t>)>;
  using Closed = std::function<void(const std::string& reason)>;

  // Opens a serial device, or the slave side of a pseudo-terminal. What had arrived before is discarded, as
  // it would be by a UART that nobody reads. Throws std::runtime_error that says what is wrong (no such
  // device, held by another process, no permission, not a serial device, a baud rate it cannot do) and what
  // to do about it.
  SerialPort(boost::asio::io_context& loop, const std::string& device, std::int64_t baud);

  // Takes over an open descriptor (read and write) as it is; `name` stands for it in messages.
  SerialPort(boost::asio::io_context& loop, int descriptor, std::string name);

  // Closes. Bytes of Write() that have not left yet are dropped (see UnsentBytes()): a device that takes none
  // would hold a close up for half a minute.
  ~SerialPort();
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  // Reads from now on. `closed` is called once, with a reason fit for a person, when no byte will come any
  // more: the device was unplugged, the other end of the pseudo-terminal is gone, an I/O error; nothing is
  // called afterwards. Call it once.
  void Start(Received received, Closed closed);

  // Sends the bytes after those before. True: all of them are on their way or queued. False: none is, since
  // the queue would grow beyond kQueueBytesMax or the port is closed.
  bool Write(std::span<const std::uint8_t> bytes);

  // Bytes of Write() that have not left this machine yet, as far as the device tells; 0 once it is closed.
  std::size_t UnsentBytes() const;

  bool IsOpen() const;

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
