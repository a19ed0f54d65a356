// Carries out the faults on nodes (faults/node_command.h): kills, pauses and restarts processes, cuts nodes
// off the bus and sets their clocks wrong, each at its time, and reverts it at its end.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "faults/node_command.h"
#include "faults/schedule.h"
#include "harness/dds/bus.h"
#include "harness/run/realtime/members.h"
#include "harness/run/realtime/node_order.h"
#include "harness/run/realtime/node_processes.h"
#include "harness/run/record.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

class NodeFaults {
 public:
  // Throws std::runtime_error for a fault that cannot be carried out on attached nodes.
  NodeFaults(const Scenario& scenario, bool attached);

  // The share of its packets that the network loses, given to each process when it starts, by role.
  const std::map<std::string, double>& loss() const { return loss_; }

  struct Means {
    const std::string& run_id;
    NodeProcesses* processes;  // null: attached
    const Members& members;
    dds::Publisher<dds::FaultCommand>& commands;
    // Starts a killed node again and takes it into the run.
    std::function<void(const std::string& role)> restart;
    std::function<void(const std::string& kind, const std::string& text)> note;
  };
  // Everything that is due at simulation time `now_ns`.
  void CarryOut(TimeNs now_ns, const Means& means);
  // Only the ends of pauses that are due, while a command waits for all nodes: no node may get an order then.
  void EndPauses(TimeNs now_ns, const Means& means);

  // Roles that a fault keeps away at present: their silence is not a loss.
  const std::set<std::string>& excused() const { return excused_; }
  // Roles whose processes a fault has stopped at present.
  const std::set<std::string>& paused() const { return paused_; }
  // The run is over: continues processes that were stopped.
  void ContinueAll(NodeProcesses& processes);

  // Writes the activations, at the end.
  void WriteTo(RecordSink& sink);
  // Drops the lateness that faults caused.
  void Excuse(RunLog& log) const;

 private:
  void Apply(const faults::NodeCommand& command, bool begin, TimeNs now_ns, const Means& means);
  void Send(const faults::NodeCommand& command, const NodeOrder& order, const Means& means);

  const Scenario& scenario_;
  std::vector<faults::NodeCommand> commands_;
  std::vector<bool> begun_, ended_;
  faults::FaultSchedule counts_;
  std::map<std::string, double> loss_;
  std::set<std::string> excused_, paused_;
  std::vector<LateSpan> disturbed_;  // while a fault acted, and a second to recover
  std::int64_t sequence_ = 0;
};

}  // namespace tiltproof::harness
