// Publish and subscribe between nodes of a distributed run: typed, without DDS showing.
//
// A thin adapter over Cyclone DDS. A Bus is this process on one DDS domain; a Publisher or Subscriber is one
// message type on it. QoS is fixed per type (qos.h). Nothing is configured outside: no file, no environment
// variable, and by default nothing leaves this machine.
//
//   dds::Bus bus({.domain = 7, .tag = "3f2a"});
//   dds::Publisher<dds::Heartbeat> heartbeat(bus);
//   dds::Subscriber<dds::RunCommand> commands(bus, [&] { loop.Post([&] { Handle(commands.Take()); }); });
//   heartbeat.Write({.node_id = "plant", .kind = dds::NodeKind::kPlant});
//
// Discovery takes a few milliseconds, and each side knows of the other at another moment: wait until
// MatchedCount() shows a reader before the first message that must arrive, because most topics keep
// nothing for latecomers (qos.h). Who asks and expects an answer needs the other side to have waited, too:
// let it say on a topic that keeps (RunAck, RunState) when its publishers are matched. Every class here may
// be used from any thread. A Bus must outlive what was made on it, and a process that forks does so before
// it makes its first Bus.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "harness/dds/messages.h"
#include "harness/dds/participant.h"
#include "harness/dds/qos.h"
#include "link/time.h"

namespace tiltproof::dds {

struct BusConfig {
  // 0 to 230. A process can be on a domain only once. Ports are 7400 + 250 * domain and up; domains 1 to 100
  // stay below the ports that the system hands out (harness/dds/domain_slot.h finds a free one).
  int domain = 1;
  // Who has another tag on the same domain is neither seen nor heard. At most 64 of A-Z a-z 0-9 _ . -
  std::string tag{};
  // Name of a network interface, or empty: this machine alone, over loopback.
  std::string interface = "";
  // Host names or addresses to look for besides those that multicast finds; only with an interface.
  std::vector<std::string> peers{};
  // Fault injection: the share of this process's packets that is lost on the way out, 0 to 1.
  double xmit_loss = 0;
  // For how long a process that is not heard stays on the bus.
  TimeNs lease_ns = kParticipantLeaseNs;
};

class Bus {
 public:
  // Throws std::runtime_error that says what is wrong with the configuration, and what to do.
  explicit Bus(const BusConfig& config);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Fault injection: for `duration_ns` this process receives nothing (deaf) or sends nothing (mute). Returns
  // at once. A new call replaces the former.
  void Partition(bool deaf, bool mute, std::int64_t duration_ns);

  // Who this process is to the others.
  Participant participant() const;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

template <class T>
class Publisher {
 public:
  // `on_match` is called, in a thread of DDS, when MatchedCount() changed; it should only post to an event
  // loop.
  explicit Publisher(Bus& bus, const std::function<void()>& on_match = {});
  // May wait up to a second for readers to acknowledge what they still miss.
  ~Publisher();
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  // Hands the message over and returns without waiting for a reader. False: a reader fell so far behind that
  // nothing more fits (64 MB of this topic); nothing was sent, and the same message may be tried again later.
  // Throws std::invalid_argument, naming the member, when the message exceeds a limit of messages.h.
  bool Write(const T& message);
  // The number of subscribers that listen now. One that died without a word counts for up to 10 s more.
  int MatchedCount() const;
  // True if a subscriber of that participant listens now.
  bool IsHeardBy(const Participant& participant) const;
  // Waits until every subscriber has everything: a node does so before it leaves. False after `limit_ns`.
  bool WaitForAcks(std::int64_t limit_ns);
  // Ends the instance named by the keys of `message`: who comes late gets nothing of it any more, and its
  // memory is free. For topics that keep messages for latecomers, when their run is over; RunEvent, which
  // keeps all, forgets only with the publisher: make one for each run.
  void Retire(const T& message);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// A log topic: every message counts, none arrives twice, and a missing one is noticed.
template <class T>
concept Log = std::same_as<T, SerialTap> || std::same_as<T, FaultActivation> || std::same_as<T, RunEvent> ||
    std::same_as<T, Records>;

// Messages of a node about itself: their node_id is the speaker's.
template <class T>
concept OfSpeaker =
    Log<T> || std::same_as<T, RunAck> || std::same_as<T, RunState> || std::same_as<T, StepResponse>;

// A topic with a deadline: two control periods.
template <class T>
concept RealTime = std::same_as<T, PlantState>;

// Messages first to last (inclusive) of a log that were skipped so far.
struct SequenceGap {
  std::string run_id{};
  std::string node_id{};
  std::int64_t first = 0;
  std::int64_t last = 0;
  bool operator==(const SequenceGap&) const = default;
};

struct NodeLife {
  Heartbeat last;           // the node's last word
  bool alive = false;       // else it missed its lease of 200 ms, or left
  Participant participant;  // who it is
};

// A message, and who sent it.
template <class T>
struct From {
  Participant sender;
  T message;
};

// Hears what comes along, and nothing else: no publisher waits for it, or keeps anything for it, even when its
// process stands still.
struct Onlooker {};

template <class T>
class Subscriber {
 public:
  // Both are called in a thread of DDS, should only post to an event loop, and may be called before the
  // constructor returns. `on_data`: Take() has something. `on_liveliness`: MatchedCount() or Nodes() changed,
  // or Nodes() will within 200 ms. Neither runs any more once the destructor returns; neither may destroy this.
  explicit Subscriber(Bus& bus, const std::function<void()>& on_data = {},
                      const std::function<void()>& on_liveliness = {});
  // Hears only those in `circle`, which must outlive this: what comes from others while they are outside is lost.
  // And what a node says of itself (OfSpeaker) only under the node id that it has there.
  Subscriber(Bus& bus, const Circle& circle, const std::function<void()>& on_data = {},
             const std::function<void()>& on_liveliness = {});
  // Messages may be missing when this process is slow.
  Subscriber(Bus& bus, Onlooker, const std::function<void()>& on_data = {});
  ~Subscriber();
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  // All messages that came since the last call, in the order in which each publisher wrote them. Logs: each
  // sequence once. Other topics that keep something for latecomers may bring it again after a cut of the
  // network of 10 s and more. When a great many are waiting, it returns the first kTakeCountMax of them, and
  // `on_data` is called for the others.
  std::vector<T> Take();
  std::vector<From<T>> TakeWithSenders() requires(!std::same_as<T, Heartbeat>);
  static constexpr std::size_t kTakeCountMax = 4096;
  int MatchedCount() const;
  // True if a publisher of that participant is there now.
  bool Hears(const Participant& participant) const;

  // Every node whose heartbeat was ever received, in the order of node ids. Each participant is one node: two of
  // the same name are two.
  std::vector<NodeLife> Nodes() const requires std::same_as<T, Heartbeat>;

  // The holes in what Take() returned so far.
  std::vector<SequenceGap> Gaps() const requires Log<T>;
  // The highest s such that Take() returned all of 1 to s of this log. Equal to the sequence of the node's last message:
  // nothing is missing.
  std::int64_t CompleteUpTo(const std::string& run_id, const std::string& node_id) const requires Log<T>;

  // The number of times that a run's next message came later than the deadline, in wall-clock time.
  std::int64_t MissedDeadlinesCount() const requires RealTime<T>;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tiltproof::dds
