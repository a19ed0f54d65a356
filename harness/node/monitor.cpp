#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <map>

#include "harness/node/roles.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

constexpr std::chrono::seconds kStatePeriod{1};

// Prints nodes as they come and go, phases, events and scores as they happen, and the vehicle once a second.
class Monitor {
 public:
  explicit Monitor(const NodeOptions& options)
      : bus_(options.bus),
        nodes_(bus_, Post(), Post()),
        states_(bus_, Post()),
        events_(bus_, Post()),
        scores_(bus_, Post()),
        plant_(bus_) {}

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

  void Look() {
    nodes_.Take();
    for (const auto& node : nodes_.Nodes()) {
      const auto [known, is_new] = alive_.try_emplace(node.participant, false);
      if (known->second == node.alive) continue;
      known->second = node.alive;
      Print(stdout, "node   {} {} on {}, process {}\n", node.alive ? "here" : "gone", node.last.node_id,
            node.last.host, node.last.pid);
    }
    for (const auto& state : states_.Take())
      Print(stdout, "state  {:10.3f} s  {} {}{}{}\n", ToSeconds(state.time_ns), state.node_id,
            Name(state.phase), state.text.empty() ? "" : ": ", state.text);
    for (const auto& event : events_.Take())
      Print(stdout, "event  {:10.3f} s  {} {}: {}\n", ToSeconds(event.time_ns), event.node_id, event.kind,
            event.text);
    for (const auto& score : scores_.Take())
      Print(stdout, "score  {} {}{}{}\n", score.scenario, score.verdict, score.reason.empty() ? "" : ": ",
            score.reason);
    std::fflush(stdout);
  }

  void Tick() {
    for (const auto& plant : plant_.Take()) {
      if (plant.state.size() < 6) continue;  // of no vehicle: any process can write it
      Print(stdout,
            "plant  {:10.3f} s  x {:.3f} y {:.3f} z {:.3f} m  roll {:.3f} pitch {:.3f} yaw {:.3f} rad\n",
            ToSeconds(plant.time_ns), plant.state[0], plant.state[1], plant.state[2], plant.state[3],
            plant.state[4], plant.state[5]);
    }
    std::fflush(stdout);
    timer_.expires_after(kStatePeriod);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) Tick();
    });
  }

  boost::asio::io_context loop_{1};
  boost::asio::steady_timer timer_{loop_};
  std::map<dds::Participant, bool> alive_;
  dds::Bus bus_;
  dds::Subscriber<dds::Heartbeat> nodes_;
  dds::Subscriber<dds::RunState> states_;
  dds::Subscriber<dds::RunEvent> events_;
  dds::Subscriber<dds::Score> scores_;
  dds::Subscriber<dds::PlantState> plant_;
};

}  // namespace

int RunMonitor(const NodeOptions& options) { return Monitor(options).Run(); }

}  // namespace tiltproof::harness
