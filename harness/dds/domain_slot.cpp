#include "harness/dds/domain_slot.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <string>

#include "link/check.h"

namespace tiltproof::dds {

DomainSlot::DomainSlot() {
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) throw std::runtime_error(std::string("cannot make a socket: ") + std::strerror(errno));
  for (domain_ = kFirst; domain_ <= kLast; ++domain_) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    // The leading NUL makes it abstract.
    const auto name = std::string(1, '\0') + "tiltproof-domain-" + std::to_string(domain_);
    Check(name.size() <= sizeof address.sun_path, "the name of a domain fits into a socket's address");
    std::memcpy(address.sun_path, name.data(), name.size());
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) == 0) return;
    if (errno != EADDRINUSE) break;
  }
  const auto reason = errno;
  close(socket_);
  if (reason != EADDRINUSE)
    throw std::runtime_error(std::string("cannot mark a DDS domain: ") + std::strerror(reason));
  throw std::runtime_error("all DDS domains from " + std::to_string(kFirst) + " to " + std::to_string(kLast) +
                           " are in use on this machine: end a run, or name a domain with --domain");
}

DomainSlot::~DomainSlot() { close(socket_); }

}  // namespace tiltproof::dds
