#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "harness/process/own_time.h"
#include "harness/run/remote/channel.h"

namespace tiltproof::harness {
namespace {

// Above any log of a flight that fits in memory; a size beyond it is not a size.
constexpr std::uint64_t kMessageBytesMax = std::uint64_t{1} << 33;

class UnixChannel final : public Channel {
 public:
  UnixChannel(int socket, pid_t peer) : socket_(socket), peer_(peer) {}
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
    std::uint64_t size = 0;
    ReadWhole({reinterpret_cast<std::uint8_t*>(&size), sizeof size}, limit_ns);
    if (size > kMessageBytesMax) throw ChannelLost(false, "the other process sent a damaged message");
    std::vector<std::uint8_t> message(size);
    ReadWhole(message, limit_ns);
    return message;
  }

 private:
  void ReadWhole(std::span<std::uint8_t> into, TimeNs limit_ns) {
    while (!into.empty()) {
      if (const Input input = AwaitInput(socket_, peer_, limit_ns); input != Input::kReady)
        throw Silent(input == Input::kStoppedItself);
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
  pid_t peer_;
  std::vector<std::uint8_t> out_;
};

}  // namespace

std::unique_ptr<Channel> MakeUnixChannel(int socket, pid_t peer) {
  return std::make_unique<UnixChannel>(socket, peer);
}

}  // namespace tiltproof::harness
