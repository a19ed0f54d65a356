#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "harness/dds/bus.h"
#include "harness/process/own_time.h"
#include "harness/run/remote/channel.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;

// One message on the bus carries at most this many bytes; longer ones go in pieces. The first byte says whether more
// follows.
constexpr std::size_t kPieceBytesMax = std::size_t{512} * 1024;
constexpr std::uint8_t kLastPiece = 0, kMorePieces = 1;
constexpr TimeNs kLimitNs = 10 * kNsPerS;
// Time that a node grants the harness: the node sees by itself that the harness is gone.
constexpr TimeNs kHarnessLimitNs = 3600 * kNsPerS;

// Wakes a poll from the threads of DDS.
class Bell {
 public:
  Bell() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~Bell() { close(fd_); }
  Bell(const Bell&) = delete;
  Bell& operator=(const Bell&) = delete;
  void Ring() const {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = write(fd_, &one, sizeof one);
  }
  void Silence() const {
    std::uint64_t count;
    [[maybe_unused]] const ssize_t got = read(fd_, &count, sizeof count);
  }
  int fd() const { return fd_; }

 private:
  int fd_;
};

// The shared part of the channels of one process: the harness writes requests and reads responses, a node the
// other way round.
template <class Out, class In>
class Exchange {
 public:
  // Hears only these peers, from the first message on.
  Exchange(dds::Bus& bus, std::string run_id, const std::vector<DdsPeer>& peers)
      : run_id_(std::move(run_id)),
        peers_(peers),
        in_(
            bus, peers_.circle, [this] { bell_.Ring(); }, [this] { bell_.Ring(); }),
        out_(bus, [this] { bell_.Ring(); }) {}

  // Both ways.
  bool Reaches(const dds::Participant& participant) const {
    return in_.Hears(participant) && out_.IsHeardBy(participant);
  }
  bool Hears(const dds::Participant& participant) const { return in_.Hears(participant); }
  bool Write(const std::string& node_id, std::int64_t sequence, const std::vector<std::uint8_t>& payload) {
    Out out;
    out.run_id = run_id_;
    out.node_id = node_id;
    out.sequence = sequence;
    out.payload = payload;
    return out_.Write(out);
  }
  // The next message of that node, or for it.
  std::optional<In> Next(const std::string& node_id) {
    std::deque<In>& queue = arrived_[node_id];
    if (queue.empty())
      for (auto& in : in_.Take())
        if (in.run_id == run_id_) arrived_[in.node_id].push_back(std::move(in));
    if (queue.empty()) return std::nullopt;
    In in = std::move(queue.front());
    queue.pop_front();
    return in;
  }
  // Until the bell rings, for `limit` at most. Throws when the other process has ended and said nothing.
  void Wait(std::chrono::milliseconds limit, int pidfd) {
    std::array<pollfd, 2> polled{{{bell_.fd(), POLLIN, 0}, {pidfd, POLLIN, 0}}};
    const int ready = poll(polled.data(), polled.size(), static_cast<int>(limit.count()));
    if (ready < 0 && errno != EINTR) throw ChannelLost(false, "waiting failed");
    if (ready == 0) return;
    bell_.Silence();
    if (ready > 0 && (polled[1].revents & POLLIN) != 0 && (polled[0].revents & POLLIN) == 0)
      throw ChannelLost(false, "the other process has ended");
  }

 private:
  std::string run_id_;
  Bell bell_;
  struct Peers {
    explicit Peers(const std::vector<DdsPeer>& peers) {
      for (const DdsPeer& peer : peers) circle.Admit(peer.participant, peer.node_id);
    }
    dds::Circle circle;
  } peers_;
  dds::Subscriber<In> in_;
  dds::Publisher<Out> out_;
  std::map<std::string, std::deque<In>> arrived_;
};

template <class Out, class In>
class DdsChannel final : public Channel {
 public:
  DdsChannel(std::shared_ptr<Exchange<Out, In>> exchange, DdsPeer peer, bool leaves_with_peer)
      : exchange_(std::move(exchange)), peer_(std::move(peer)), leaves_with_peer_(leaves_with_peer) {}

  void Send(std::span<const std::uint8_t> message) override {
    do {
      const auto piece = message.first(std::min(message.size(), kPieceBytesMax));
      message = message.subspan(piece.size());
      std::vector<std::uint8_t> payload = {message.empty() ? kLastPiece : kMorePieces};
      payload.insert(payload.end(), piece.begin(), piece.end());
      ++sent_;
      // Full only while the other side takes in a long log.
      OwnTime own(peer_.pid);
      while (!exchange_->Write(peer_.node_id, sent_, payload)) {
        exchange_->Wait(std::chrono::milliseconds(10), peer_.pidfd);
        if (own.Look(SteadyClock::now()) > kLimitNs)
          throw ChannelLost(true, "the other process takes no more messages");
      }
    } while (!message.empty());
  }

  std::vector<std::uint8_t> Receive(TimeNs limit_ns) override {
    OwnTime own(peer_.pid);
    std::vector<std::uint8_t> message;
    for (;;) {
      const bool over = own.Look(SteadyClock::now()) >= limit_ns;
      const auto in = exchange_->Next(peer_.node_id);
      if (!in) {
        if (leaves_with_peer_ && !exchange_->Hears(peer_.participant))
          throw ChannelLost(false, "the harness has left the bus");
        if (over) throw Silent(own.stopped_itself());
        exchange_->Wait(OwnTime::kLook, peer_.pidfd);
        continue;
      }
      if (in->payload.empty() || in->sequence != ++received_)
        throw ChannelLost(false, fmt::format("message {} of the other process was lost", received_));
      message.insert(message.end(), in->payload.begin() + 1, in->payload.end());
      if (in->payload.front() == kLastPiece) return message;
    }
  }

 private:
  std::shared_ptr<Exchange<Out, In>> exchange_;
  DdsPeer peer_;
  bool leaves_with_peer_;
  std::int64_t sent_ = 0, received_ = 0;
};

}  // namespace

dds::BusConfig LockstepBus(int domain, const std::string& run_id) {
  // The longest that there is.
  return {.domain = domain, .tag = run_id, .lease_ns = 3600 * kNsPerS};
}

std::unique_ptr<Channel> MakeDdsChannel(dds::Bus& bus, const std::string& run_id, const std::string& node_id,
                                        const dds::Participant& harness) {
  const DdsPeer peer{.node_id = node_id, .participant = harness};
  auto exchange =
      std::make_shared<Exchange<dds::StepResponse, dds::StepRequest>>(bus, run_id, std::vector{peer});
  OwnTime own;
  while (!exchange->Reaches(harness)) {
    exchange->Wait(std::chrono::milliseconds(2), -1);
    if (own.Look(SteadyClock::now()) > kHarnessLimitNs)
      throw ChannelLost(
          true, fmt::format("the harness was not found on the bus within {} s", kHarnessLimitNs / kNsPerS));
  }
  auto channel = std::make_unique<DdsChannel<dds::StepResponse, dds::StepRequest>>(exchange, peer, true);
  // The harness may speak when it has heard from everybody: then everybody hears it.
  channel->Send({});
  return channel;
}

std::vector<std::unique_ptr<Channel>> MakeDdsChannels(dds::Bus& bus, const std::string& run_id,
                                                      const std::vector<DdsPeer>& peers) {
  auto exchange = std::make_shared<Exchange<dds::StepRequest, dds::StepResponse>>(bus, run_id, peers);
  std::vector<std::unique_ptr<Channel>> channels;
  for (const DdsPeer& peer : peers) {
    channels.push_back(
        std::make_unique<DdsChannel<dds::StepRequest, dds::StepResponse>>(exchange, peer, false));
    channels.back()->Receive(kLimitNs);
  }
  return channels;
}

}  // namespace tiltproof::harness
