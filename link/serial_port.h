// A serial port (or any other descriptor of bytes both ways) in an event loop: raw, exclusive, no flow
// control. For firmware on a board, for both ends of a pseudo-terminal (link/pty.h), and for an emulator's port behind
// a unix socket (link/unix_socket.h).
//
//   boost::asio::io_context loop;
//   SerialPort port(loop, "/dev/ttyUSB0", 921'600, {.parity = Parity::kEven});
//   port.Start([&](std::span<const std::uint8_t> bytes) { decoder.Feed(bytes); },
//              [&](const std::string& reason) { Lost(reason); });   // unplugged, hung up, ...
//   port.Write(frame);
//   loop.run();
//
// All calls must come from the thread that runs the loop. The loop calls the callbacks, never from within a
// call to the port, and they may destroy the port. The loop must outlive it. Nothing here blocks.
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
#include "link/character.h"

namespace boost::asio {
class io_context;
}

namespace tiltproof::link {

// An output of a serial port beside its data (TIA-232: DTR, RTS). On: the line of a TTL adapter is low.
enum class ModemLine : std::uint8_t { kDtr, kRts };

class SerialPort final : public ByteLine {
 public:
  static constexpr std::int64_t kBaudMin = 50;
  static constexpr std::int64_t kBaudMax = 20'000'000;

  // Opens a serial device, or the slave side of a pseudo-terminal: what had arrived before is discarded, as a
  // UART that is not read would do. Or connects to a socket, `unix:PATH` or `unix:@NAME`, which keeps every
  // byte and has no baud rate. Throws std::runtime_error that says what is wrong (no such device, held by
  // another process, no permission, not a serial device, an impossible baud rate, no listening process) and
  // what to do about it.
  // A byte with a parity error is received as it came (INPCK is off, termios(3)). A pseudo-terminal and a socket
  // carry whole bytes, whatever the format.
  SerialPort(boost::asio::io_context& loop, const std::string& device, std::int64_t baud,
             const CharacterFormat& character = {});

  // Takes over an open descriptor (read and write) as it is; `name` identifies it in messages.
  SerialPort(boost::asio::io_context& loop, int descriptor, std::string name);

  // Closes the port. Bytes of Write() that have not left yet are dropped (see UnsentBytes()): a device that
  // accepts none would otherwise delay closing by half a minute.
  ~SerialPort() override;

  // The port closes when the device was unplugged, the other end of the pseudo-terminal or socket is gone, or
  // I/O fails.
  void Start(Received received, Closed closed) override;
  bool Write(std::span<const std::uint8_t> bytes) override;

  // Bytes of Write() that have not left this machine yet, as far as the device reports; 0 once the port is
  // closed.
  std::size_t UnsentBytes() const;

  // Bytes that have arrived since the port was opened and were not read yet; 0 once the port is closed.
  std::size_t UnreadBytes() const;

  bool IsOpen() const;

  // True if a byte takes its time at the baud rate. On a pseudo-terminal or a socket it takes no time.
  bool TakesByteTime() const;

  // Throws std::runtime_error that says what to do when the device has no such line: a pseudo-terminal, a socket.
  void SetModemLine(ModemLine line, bool on);

  // The process at the other end of a socket, if it is on this machine; nullopt when it is unknown.
  std::optional<pid_t> PeerProcess() const;

  // The settings that the operating system has accepted.
  struct LowLatency {
    bool driver = false;                  // ASYNC_LOW_LATENCY: bytes are passed on at once
    std::optional<int> latency_timer_ms;  // of an FTDI adapter, now; nullopt for other devices
    std::string advice;                   // empty when nothing is left to do
  };
  // Asks the driver and the adapter to pass received bytes on at once. Never fails; returns what was
  // achieved.
  LowLatency SetLowLatency(const std::filesystem::path& root = "/");

 private:
  class State;
  std::shared_ptr<State> state_;
};

}  // namespace tiltproof::link
