// One end of a serial line in an event loop: a serial port (link/serial_port.h), or a socket that represents
// one (link/socket_line.h).
//
// All calls must come from the thread that runs the loop. The loop calls the callbacks, never from within a
// call to the line, and they may destroy the line. Nothing blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace tiltproof::link {

class ByteLine {
 public:
  // Limit of what Write() holds when bytes leave more slowly than they come: 11 s at 921600 baud.
  static constexpr std::size_t kQueueBytesMax = std::size_t{1} << 20;

  using Received = std::function<void(std::span<const std::uint8_t>)>;
  using Closed = std::function<void(const std::string& reason)>;

  ByteLine() = default;
  virtual ~ByteLine() = default;
  ByteLine(const ByteLine&) = delete;
  ByteLine& operator=(const ByteLine&) = delete;

  // Starts reading. `closed` is called once, with a reason fit for a person, when no more bytes will come;
  // nothing is called afterwards. Call it once.
  virtual void Start(Received received, Closed closed) = 0;

  // Sends the bytes after the earlier ones. True: all of them are on their way or queued. False: none is,
  // because the queue would grow beyond kQueueBytesMax or no peer is connected.
  virtual bool Write(std::span<const std::uint8_t> bytes) = 0;
};

}  // namespace tiltproof::link
