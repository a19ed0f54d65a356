// Serial lines over unix stream sockets: emulators and simulators (for example QEMU with -chardev socket)
// offer the serial ports of their machine in this way.
//
// A name is `unix:PATH`, or `unix:@NAME` for a name that is not a file (the abstract namespace of Linux).
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace tiltproof::link {

// A file descriptor that this object closes at its end.
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

// Checks whether there is such a socket without connecting to it: the listening process may accept only one
// caller. Nullopt when there is, otherwise what is wrong and what to do.
std::optional<std::string> SocketTrouble(const std::string& name);

// A connected, non-blocking descriptor. Throws std::runtime_error that says what is wrong: no process listens
// there, no permission, not a stream socket.
OwnedDescriptor ConnectSocket(const std::string& name);

}  // namespace tiltproof::link
