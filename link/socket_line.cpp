// Boost 1.74's Asio uses std::exchange without its header.
#include <utility>
//
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "link/socket_line.h"

namespace tiltproof::link {
namespace {

constexpr int kWaitingMax = 1;

// A listening socket with a name of the kernel's choice: bound to an address without one (unix(7), "Autobind").
OwnedDescriptor Listen(std::string& abstract_name) {
  OwnedDescriptor listener(socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof address;
  if (listener.get() < 0 || bind(listener.get(), generic, sizeof address.sun_family) != 0 ||
      listen(listener.get(), kWaitingMax) != 0 || getsockname(listener.get(), generic, &size) != 0)
    throw std::runtime_error(std::string("cannot make a socket for a serial line: ") + std::strerror(errno));
  abstract_name.assign(address.sun_path + 1, size - offsetof(sockaddr_un, sun_path) - 1);
  return listener;
}

bool IsOurUser(int descriptor) {
  ucred peer{};
  socklen_t size = sizeof peer;
  return getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
         (peer.uid == geteuid() || peer.uid == 0);
}

}  // namespace

SocketLine::SocketLine(boost::asio::io_context& loop) : loop_(loop), listener_(loop) {
  OwnedDescriptor listener = Listen(abstract_name_);
  listener_.assign(listener.get());
  listener.Release();
}

SocketLine::~SocketLine() = default;

void SocketLine::Start(Received received, Closed closed) {
  received_ = std::move(received);
  closed_ = std::move(closed);
  Await();
}

bool SocketLine::Write(std::span<const std::uint8_t> bytes) {
  return peer_ != nullptr && peer_->Write(bytes);
}

void SocketLine::Await() {
  listener_.async_wait(boost::asio::posix::stream_descriptor::wait_read,
                       [this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                         if (error || alive.expired()) return;
                         if (!Accept()) {
                           const std::string why = std::strerror(errno);
                           listener_.close();
                           if (closed_) closed_("the line at " + name() + " failed: " + why);
                         } else if (peer_ == nullptr) {
                           Await();
                         }
                       });
}

bool SocketLine::Accept() {
  OwnedDescriptor accepted(
      accept4(listener_.native_handle(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  // ECONNABORTED: the peer has left already.
  if (accepted.get() < 0) return errno == EAGAIN || errno == EINTR || errno == ECONNABORTED;
  if (!IsOurUser(accepted.get())) return true;
  peer_ = std::make_unique<SerialPort>(loop_, accepted.Release(), "the line at " + name());
  peer_->Start([this](std::span<const std::uint8_t> bytes) { received_(bytes); },
               [this](const std::string&) {
                 peer_.reset();
                 Await();
               });
  return true;
}

}  // namespace tiltproof::link
