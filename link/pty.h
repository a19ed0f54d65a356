// A pseudo-terminal pair: a serial line without hardware. Firmware that runs as a process opens the slave
// path like a serial port; this object is the other end of its cable.
//
//   Pty pty(loop);
//   pty.master().Start(received, closed);
//   Spawn({"firmware", "--port", pty.slave_path()});
//
// Raw on both sides from the start. The peer may open the slave late, close it and open it again; this end
// stays open, as a UART does. While no process reads the slave, bytes wait for the peer, as on any
// pseudo-terminal (some 64 KiB in the kernel, then in the master's queue). A peer that opens it as
// link::SerialPort discards what the kernel kept. The pair vanishes with this object.
#pragma once

#include <string>

#include "link/serial_port.h"

namespace tiltproof::link {

class Pty {
 public:
  // Throws std::runtime_error when the machine has no pseudo-terminal left.
  explicit Pty(boost::asio::io_context& loop);
  ~Pty();
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;

  const std::string& slave_path() const { return slave_path_; }
  SerialPort& master() { return *master_; }

 private:
  // Kept open so that the master sees no hang-up while no peer has the slave open.
  int slave_ = -1;
  std::string slave_path_;
  std::unique_ptr<SerialPort> master_;
};

}  // namespace tiltproof::link
