#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

#include "harness/node/roles.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

constexpr std::chrono::seconds kStatePeriod{1};

// Prints nodes as they come and go, phases, events and scores as they happen, and the vehicle once a second.
class Monitor {
 public:
  Monitor(const NodeOptions& options, FindWatchTarget find_target)
      : options_(options), find_target_(std::move(find_target)) {}

  int Run() {
    boost::asio::signal_set signals(loop_, SIGTERM, SIGINT, SIGHUP);
    signals.async_wait([this](const boost::system::error_code& error, int) {
      if (!error) loop_.stop();
    });
    Tick();
    loop_.run();
    return 0;
  }

 private:
  std::function<void()> Post() {
    return [this] { boost::asio::post(loop_, [this] { Look(); }); };
  }

  // Goes to where the target is.
  void Follow() {
    const WatchTarget target = find_target_();
    if (target == target_) return;
    target_ = target;
    Print(stderr, "tiltproof: {}\n", target.text);
    // A process can be on a domain only once.
    ears_.reset();
    alive_.clear();
    if (!target.place) return;
    dds::BusConfig config = options_.bus;
    config.domain = target.place->domain;
    config.tag = target.place->tag;
    ears_.emplace(config, Post());
  }

  void Look() {
    if (!ears_) return;
    ears_->nodes.Take();
    for (const auto& node : ears_->nodes.Nodes()) {
      const auto [known, is_new] = alive_.try_emplace(node.participant, false);
      if (known->second == node.alive) continue;
      known->second = node.alive;
      Print(stdout, "node   {} {} on {}, process {}\n", node.alive ? "here" : "gone", node.last.node_id,
            node.last.host, node.last.pid);
    }
    for (const auto& state : ears_->states.Take())
      Print(stdout, "state  {:10.3f} s  {} {}{}{}{}\n", ToSeconds(state.time_ns), state.node_id,
            Name(state.phase), state.role < 0 ? "" : fmt::format(", role {}", state.role),
            state.text.empty() ? "" : ": ", state.text);
    for (const auto& event : ears_->events.Take())
      Print(stdout, "event  {:10.3f} s  {} {}: {}\n", ToSeconds(event.time_ns), event.node_id, event.kind,
            event.text);
    for (const auto& score : ears_->scores.Take())
      Print(stdout, "score  {} {}{}{}\n", score.scenario, score.verdict, score.reason.empty() ? "" : ": ",
            score.reason);
    std::fflush(stdout);
  }

  void Tick() {
    Follow();
    PrintPlant();
    std::fflush(stdout);
    timer_.expires_after(kStatePeriod);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) Tick();
    });
  }

  void PrintPlant() {
    if (!ears_) return;
    for (const auto& plant : ears_->plant.Take()) {
      if (plant.state.size() < 6) continue;  // of no vehicle: any process can write it
      Print(stdout,
            "plant  {:10.3f} s  x {:.3f} y {:.3f} z {:.3f} m  roll {:.3f} pitch {:.3f} yaw {:.3f} rad\n",
            ToSeconds(plant.time_ns), plant.state[0], plant.state[1], plant.state[2], plant.state[3],
            plant.state[4], plant.state[5]);
    }
  }

  struct Ears {
    Ears(const dds::BusConfig& config, const std::function<void()>& wake)
        : bus(config),
          nodes(bus, wake, wake),
          states(bus, wake),
          events(bus, wake),
          scores(bus, wake),
          plant(bus) {}
    dds::Bus bus;
    dds::Subscriber<dds::Heartbeat> nodes;
    dds::Subscriber<dds::RunState> states;
    dds::Subscriber<dds::RunEvent> events;
    dds::Subscriber<dds::Score> scores;
    dds::Subscriber<dds::PlantState> plant;
  };

  const NodeOptions& options_;
  const FindWatchTarget find_target_;
  std::optional<WatchTarget> target_;
  boost::asio::io_context loop_{1};
  boost::asio::steady_timer timer_{loop_};
  std::map<dds::Participant, bool> alive_;
  std::optional<Ears> ears_;
};

}  // namespace

int RunMonitor(const NodeOptions& options, const FindWatchTarget& target) {
  return Monitor(options, target).Run();
}

}  // namespace tiltproof::harness
