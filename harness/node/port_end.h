// A node's end of a serial line to firmware: the port of a board, or a port that the node makes, for a program to open or
// an emulator to connect to.
//
//   PortEnd end;
//   end.Open(services, {.for_emulator = true, .name = "client"}, ports);  // adds its path to the ports
//   end.ConnectSocket(services.loop());                                    // when the flight starts
//   if (end.line != nullptr) end.line->Start(received, closed);
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "harness/node/node.h"
#include "link/byte_line.h"
#include "link/pty.h"
#include "link/serial_port.h"
#include "link/socket_line.h"
#include "link/wire.h"

namespace tiltproof::harness {

struct PortEnd {
  struct Place {
    std::string device;  // of the board, or the name of a socket (unix:PATH); empty: the node makes a port
    std::int64_t baud = 0;
    link::CharacterFormat character = {};
    bool for_emulator = false;               // the port that the node makes is a socket
    std::string name;                        // of the port, for other nodes
    std::optional<std::size_t> client = {};  // whose board it is, of several
  };

  // A socket that another program offers is connected by ConnectSocket. Throws std::runtime_error when the device cannot
  // be opened.
  void Open(NodeServices& services, const Place& place, Ports& ports);
  // Does nothing when there is none.
  void ConnectSocket(boost::asio::io_context& loop);
  // The hardware at its other side takes the time of each byte.
  bool TakesByteTime() const { return serial && serial->TakesByteTime(); }

  std::unique_ptr<link::Pty> pty;            // for a program
  std::unique_ptr<link::SocketLine> socket;  // for an emulator of ours
  std::unique_ptr<link::SerialPort> serial;  // of a board, or of an emulator that the user has started
  std::string socket_name;                   // of the latter
  link::ByteLine* line = nullptr;            // it; null while nothing is connected
};

// When to look next at a line on which the next bytes arrive at `arrival`. An emulated USART takes bytes one at a time, and
// needs some time for each. Like a real one it gets them as they arrive, not a frame at once. Other clients are woken
// for whole frames only.
BootTime NextHandOver(BootTime arrival, bool takes_bytes, BootTime now);

}  // namespace tiltproof::harness
