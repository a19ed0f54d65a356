#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>

#include "harness/run/remote/channel.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Above any log of a flight that fits in memory; a size beyond it is not a size.
constexpr std::uint64_t kMessageBytesMax = std::uint64_t{1} << 33;

class UnixChannel final : public Channel {
 public:
  explicit UnixChannel(int socket) : socket_(socket) {}
  ~UnixChannel() override { close(socket_); }
  UnixChannel(const UnixChannel&) = delete;
  UnixChannel& operator=(const UnixChannel&) = delete;

  void Send(std::span<const std::uint8_t> message) override {
    const std::uint64_t size = message.size();
    out_.resize(sizeof size + message.size());
    std::memcpy(out_.data(), &size, sizeof size);
    if (!message.empty()) std::memcpy(out_.data() + sizeof size, message.data(), message.size());
    std::span<const std::uint8_t> rest = out_;
    while (!rest.empty()) {
      const ssize_t sent = send(socket_, rest.data(), rest.size(), MSG_NOSIGNAL);
      if (sent < 0) {
        if (errno == EINTR) continue;
        throw ChannelLost(false, fmt::format("the other process is gone ({})", std::strerror(errno)));
      }
      rest = rest.subspan(static_cast<std::size_t>(sent));
    }
  }

  std::vector<std::uint8_t> Receive(TimeNs limit_ns) override {
    const auto until = SteadyClock::now() + std::chrono::nanoseconds(limit_ns);
    std::uint64_t size = 0;
    ReadWhole({reinterpret_cast<std::uint8_t*>(&size), sizeof size}, until);
    if (size > kMessageBytesMax) throw ChannelLost(false, "the other process sent a damaged message");
    std::vector<std::uint8_t> message(size);
    ReadWhole(message, until);
    return message;
  }

 private:
  void ReadWhole(std::span<std::uint8_t> into, SteadyClock::time_point until) {
    while (!into.empty()) {
      pollfd polled{socket_, POLLIN, 0};
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(until - SteadyClock::now()).count();
      const int ready = left < 0 ? 0 : poll(&polled, 1, static_cast<int>(left) + 1);
      if (ready == 0) throw ChannelLost(true, "the other process does not answer");
      if (ready < 0 && errno != EINTR)
        throw ChannelLost(false, fmt::format("waiting failed: {}", std::strerror(errno)));
      if (ready < 0) continue;
      const ssize_t got = recv(socket_, into.data(), into.size(), 0);
      if (got == 0) throw ChannelLost(false, "the other process has closed the connection");
      if (got < 0) {
        if (errno == EINTR) continue;
        throw ChannelLost(false, fmt::format("the other process is gone ({})", std::strerror(errno)));
      }
      into = into.subspan(static_cast<std::size_t>(got));
    }
  }

  int socket_;
  std::vector<std::uint8_t> out_;
};

}  // namespace

std::unique_ptr<Channel> MakeUnixChannel(int socket) { return std::make_unique<UnixChannel>(socket); }

}  // namespace tiltproof::harness
