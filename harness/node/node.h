// A node: one process of a real-time run, found and led by the harness over the bus.
//
// All nodes work in the same way, and only their Roles differ. A node reports every 50 ms that it is there,
// loads the scenario that it is given, opens its ports, runs, hands in its log, and is free again.
//
//   prepare -> what it needs exists      arm -> its ports are open      start -> it runs
//   stop    -> its log is handed in      release -> it is free (a child of the harness ends)
//
// One thread does all of the node's work, in an event loop; the threads of DDS only post to it. So the
// heartbeat stops when the work hangs, which is its purpose.
#pragma once

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "faults/fault_type.h"
#include "harness/dds/bus.h"
#include "harness/node/node_clock.h"
#include "harness/run/realtime/log_messages.h"
#include "harness/run/remote/serve.h"
#include "harness/run/run_log.h"
#include "harness/scenario/client_spec.h"

namespace tiltproof::harness {

struct NodeOptions {
  dds::NodeKind kind = dds::NodeKind::kPlant;
  std::string name;  // node id
  dds::BusConfig bus;
  // Started by a harness, which is that participant: it obeys only this harness, and ends after its run.
  // Otherwise started by a person, for any number of runs.
  std::optional<dds::Participant> harness;
  ScenarioLoader load;
  // Client: the firmware that it is. Link: the board on its cables; without one, it makes pseudo-terminals.
  std::optional<ClientSpec> client;
  // Client and link, on two hosts: this node's end of the serial cables between them.
  std::optional<SerialBoard> cable;
  // Line: the devices of its two ends; it makes a port for an end without one.
  std::array<std::string, 2> end_devices = {};
  // Client and link: the id of their client among several. Line: its id.
  std::string id;
  // Joystick: a device, or a recording.
  std::string joystick_source;
};

using Ports = std::vector<dds::Port>;
// The kind of a link node's client, or those of the clients at a line node's two ends.
using ClientKinds = std::vector<std::optional<ClientSpec>>;
// The path of a port; empty when there is no port of that name.
std::string FindPort(const Ports& ports, std::string_view name);

// A callback for subscribers, which are called in threads of DDS: makes the loop call `look`, as long as
// `alive` exists.
std::function<void()> InLoop(boost::asio::io_context& loop, const std::shared_ptr<char>& alive,
                             std::function<void()> look);

// The services of a node to its role.
class NodeServices {
 public:
  virtual ~NodeServices() = default;
  virtual boost::asio::io_context& loop() = 0;
  virtual dds::Bus& bus() = 0;
  virtual NodeClock& clock() = 0;
  virtual const std::string& run_id() const = 0;
  // The nodes of the current run.
  virtual const dds::Circle& members() const = 0;
  virtual RecordSink& log() = 0;
  // `client`: that it concerns, of several.
  void Note(TimeNs time_ns, std::string kind, std::string text, std::optional<std::size_t> client = {}) {
    log().Write({time_ns, client, record::Event{std::move(kind), std::move(text)}});
  }
  virtual Lateness& lateness() = 0;
  // Tells the harness the node's state; kFailed ends the run.
  virtual void SetPhase(dds::Phase phase, TimeNs time_ns, Origin origin, EndReason reason,
                        const std::string& text) = 0;
  // A client fails, of several, on whose line this node is; an empty id: the line, and no client. The node works on.
  virtual void FailClient(const std::string& client_id, EndReason reason, const std::string& text) = 0;
  // Tells the plant the role of this node's client among several (ClientRole), when it changes.
  virtual void TellRole(std::uint32_t role) = 0;
  // As SetPhase for a failure of the node itself, named by `reason`.
  void Fail(EndReason reason, const std::string& text) { SetPhase(dds::Phase::kFailed, 0, {}, reason, text); }
};

// The work of one kind of node, during one run. Any call may throw std::exception; its text goes to the
// harness.
class Role {
 public:
  virtual ~Role() = default;
  // Returns the ports that it offers to others. `clients`: the kinds of those on them, as far as they are known.
  virtual Ports Prepare(const LoadedScenario& loaded, const ClientKinds& clients) = 0;
  virtual void Arm(const Ports& ports) = 0;
  virtual void Start() = 0;
  // Where faults of that type act: the simulation time up to which this role has done its work, so that one more
  // can only begin later. Nullopt where they do not act.
  virtual std::optional<TimeNs> DoneUntil(const faults::FaultType& /*type*/) { return std::nullopt; }
  // One more fault, while it flies; it acts where its kind acts, and means nothing to the other roles.
  virtual void Inject(const faults::FaultSpec& /*fault*/) {}
  // Called every 50 ms from Start on, before the log so far is sent: writes records that wait for it.
  virtual void Flush() = 0;
  // Writes the rest of the log and its totals.
  virtual void Stop() = 0;
};
using MakeRole = std::function<std::unique_ptr<Role>(NodeServices&, const NodeOptions&)>;

// Runs until it is told to end (SIGTERM, SIGINT, the harness that started it is done). Returns the process's
// exit code.
int RunNode(const NodeOptions& options, const MakeRole& make_role);

// Calls `due(now)` every `period` of the node's clock from `first` on, in the loop, and records how late each
// call was, until it is destroyed.
class PeriodicTimer {
 public:
  PeriodicTimer(NodeServices& services, BootTime first, TimeNs period, std::function<void(BootTime)> due);
  // An overdue call is lateness, too.
  ~PeriodicTimer() { services_.lateness().Note(next_ns_, services_.clock().Now()); }
  PeriodicTimer(const PeriodicTimer&) = delete;
  PeriodicTimer& operator=(const PeriodicTimer&) = delete;

 private:
  void Arm();
  NodeServices& services_;
  BootTime next_ns_;
  TimeNs period_ns_;
  std::function<void(BootTime)> due_;
  boost::asio::steady_timer timer_;
  // A wait that is already over calls back even when this object is destroyed first.
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::harness
