// A serial line for a peer that uses a unix stream socket, such as an emulator. This end listens, like a wall
// socket, and one peer at a time is plugged in.
//
//   SocketLine line(loop);
//   line.Start(received, closed);
//   Spawn({"qemu-system-arm", "-chardev", "socket,id=main,abstract=on,path=" + line.abstract_name(), ...});
//
// The peer may come late, leave and come back; this end stays. What is written while no peer is plugged in is
// lost, as on a cable. A second peer waits until the first has left. Peers of other users are refused.
#pragma once

#include <boost/asio/posix/stream_descriptor.hpp>
#include <memory>
#include <string>

#include "link/byte_line.h"
#include "link/serial_port.h"
#include "link/unix_socket.h"

namespace tiltproof::link {

class SocketLine final : public ByteLine {
 public:
  // Listens under a name that the kernel chooses. Throws std::runtime_error when it cannot.
  explicit SocketLine(boost::asio::io_context& loop);
  ~SocketLine() override;

  // "unix:@NAME", as SerialPort takes it; it vanishes with this object.
  std::string name() const { return "unix:@" + abstract_name_; }
  const std::string& abstract_name() const { return abstract_name_; }

  // `closed` comes only when no peer can be heard any more.
  void Start(Received received, Closed closed) override;
  bool Write(std::span<const std::uint8_t> bytes) override;

  bool HasPeer() const { return peer_ != nullptr; }

 private:
  void Await();
  // False when the listening socket itself has failed.
  bool Accept();

  boost::asio::io_context& loop_;
  boost::asio::posix::stream_descriptor listener_;
  std::string abstract_name_;
  Received received_;
  Closed closed_;
  std::unique_ptr<SerialPort> peer_;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::link
