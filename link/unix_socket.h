// Serial lines over unix stream sockets: how emulators and simulators (QEMU's -chardev socket, for one) offer the
// serial ports of the machine they play.
//
// A name is `unix:PATH`, or `unix:@NAME` for a name that is no file (the abstract namespace of Linux).
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace tiltproof::link {

// A file descriptor that is closed with this object.
class OwnedDescriptor {
 public:
  explicit OwnedDescriptor(int value = -1) : value_(value) {}
  ~OwnedDescriptor();
  OwnedDescriptor(OwnedDescriptor&& other) noexcept : value_(other.Release()) {}
  OwnedDescriptor& operator=(OwnedDescriptor&& other) noexcept;
  OwnedDescriptor(const OwnedDescriptor&) = delete;
  OwnedDescriptor& operator=(const OwnedDescriptor&) = delete;
  int get() const { return value_; }
  int Release();

 private:
  int value_;
};

bool IsSocketName(std::string_view name);

// Whether there is such a socket, without calling it: who listens may take one caller only. Nullopt when there is,
// else what is wrong and what to do.
std::optional<std::string> SocketTrouble(const std::string& name);

// A connected, non-blocking descriptor. Throws std::runtime_error that says what is wrong: nobody listens there,
// no permission, not a stream socket.
OwnedDescriptor ConnectSocket(const std::string& name);

}  // namespace tiltproof::link
