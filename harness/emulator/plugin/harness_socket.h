// The plug-in's end of the socket to the harness (harness/emulator/lockstep_protocol.h).
//
//   socket.Send(Kind::kHello, &hello, sizeof(hello));
//   socket.Flush();
//
// When the harness is gone the emulator ends at once, without a word.
#pragma once

#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <vector>

#include "harness/emulator/lockstep_protocol.h"

namespace tiltproof::qemu {

class HarnessSocket {
 public:
  // A connected descriptor, which stays the caller's.
  void Use(int descriptor) { descriptor_ = descriptor; }
  bool open() const { return descriptor_ >= 0; }

  // Queues a message.
  void Send(harness::lockstep::Kind kind, const void* body, std::size_t size) {
    const harness::lockstep::Header header{kind, static_cast<std::uint32_t>(size)};
    Append(&header, sizeof(header));
    Append(body, size);
  }

  void Flush() {
    for (std::size_t sent = 0; sent < out_.size();) {
      const ssize_t n = send(descriptor_, out_.data() + sent, out_.size() - sent, MSG_NOSIGNAL);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) _exit(0);
      sent += static_cast<std::size_t>(n);
    }
    out_.clear();
  }

  // Waits for all of it.
  void Receive(void* buffer, std::size_t size) {
    auto* at = static_cast<std::uint8_t*>(buffer);
    while (size != 0) {
      const ssize_t n = recv(descriptor_, at, size, 0);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) _exit(0);
      at += n;
      size -= static_cast<std::size_t>(n);
    }
  }

 private:
  void Append(const void* bytes, std::size_t size) {
    const auto* first = static_cast<const std::uint8_t*>(bytes);
    out_.insert(out_.end(), first, first + size);
  }

  int descriptor_ = -1;
  std::vector<std::uint8_t> out_;
};

}  // namespace tiltproof::qemu
