#include "harness/run/realtime/node_faults.h"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <stdexcept>
#include <utility>

namespace tiltproof::harness {
namespace {

// The plant's word on the time is up to a period old.
constexpr TimeNs kBeforeNs = 50 * kNsPerMs;
constexpr TimeNs kRecoveryNs = kNsPerS;

}  // namespace

NodeFaults::NodeFaults(const Scenario& scenario, bool attached)
    : scenario_(scenario),
      commands_(faults::NodeCommands(scenario.faults)),
      begun_(commands_.size(), false),
      ended_(commands_.size(), false),
      counts_(scenario.faults, scenario.seed) {
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    const faults::NodeCommand& command = commands_[i];
    const std::string& id = scenario.faults[command.fault].id;
    if (attached && command.type == "dds.loss")
      throw std::runtime_error(fmt::format(
          "fault '{}': attached nodes have joined the bus already; start them with --xmit-loss", id));
    if (attached && command.type.starts_with("node."))
      throw std::runtime_error(fmt::format(
          "fault '{}': {} needs nodes that the harness starts itself, not attached ones", id, command.type));
    if (command.type != "dds.loss") continue;
    // It is set when the node joins, once and for all.
    begun_[i] = ended_[i] = true;
    loss_[command.node] = command.parameters.Number("probability");
    counts_.Count(command.fault, 0, command.node + " loses packets");
  }
}

void NodeFaults::CarryOut(TimeNs now_ns, const Means& means) {
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    if (!begun_[i] && now_ns >= commands_[i].at_ns) {
      begun_[i] = true;
      Apply(commands_[i], true, now_ns, means);
    }
    if (begun_[i] && !ended_[i] && now_ns >= commands_[i].until_ns) {
      ended_[i] = true;
      Apply(commands_[i], false, now_ns, means);
    }
  }
}

void NodeFaults::Apply(const faults::NodeCommand& command, bool begin, TimeNs now_ns, const Means& means) {
  const std::string& node = command.node;
  ChildProcess* process = means.processes != nullptr ? means.processes->Find(node) : nullptr;
  std::string what;
  if (command.type == "node.kill" && process != nullptr) {
    process->Signal(SIGKILL);
    what = "killed";
  } else if (command.type == "node.pause" && process != nullptr) {
    process->Signal(begin ? SIGSTOP : SIGCONT);
    if (begin)
      paused_.insert(node);
    else
      paused_.erase(node);
    what = begin ? "stopped" : "continued";
  } else if (command.type == "node.restart" && process != nullptr) {
    what = begin ? "killed, to be started again" : "started again";
    if (begin) {
      excused_.insert(node);
      process->Signal(SIGKILL);
    } else {
      means.restart(node);
      excused_.erase(node);
    }
  } else if (command.type == "dds.partition") {
    what = begin ? "cut off the bus" : "on the bus again";
    if (begin) {
      excused_.insert(node);
      Send(command, begin, means);
    } else {
      excused_.erase(node);
    }
  } else if (command.type == "clock.skew") {
    what = begin ? "clock skewed" : "clock at its true rate";
    Send(command, begin, means);
  } else {
    throw std::runtime_error(fmt::format("fault '{}': there is no {} node to suffer {}",
                                         scenario_.faults[command.fault].id, node, command.type));
  }
  means.note(command.type, fmt::format("{}: {} {}", scenario_.faults[command.fault].id, node, what));
  if (begin) counts_.Count(command.fault, now_ns, node + " " + what);
  disturbed_.push_back({now_ns - kBeforeNs, now_ns + kRecoveryNs});
  if (!begin) disturbed_.back().begin_ns = command.at_ns - kBeforeNs;
}

void NodeFaults::Send(const faults::NodeCommand& command, bool begin, const Means& means) {
  for (const Member& member : means.members.all()) {
    if (command.node != "all" && Name(member.kind) != command.node) continue;
    dds::FaultCommand out;
    out.run_id = means.run_id;
    out.node_id = member.id;
    out.sequence = ++sequence_;
    out.fault_id = scenario_.faults[command.fault].id;
    out.type = command.type;
    if (command.type == "dds.partition")
      out.duration_ns = command.until_ns == kNever ? 3600 * kNsPerS : command.until_ns - command.at_ns;
    if (command.type == "clock.skew" && begin)
      out.parameters = {{"ppm", command.parameters.Number("ppm")},
                        {"offset_ms", command.parameters.Number("offset_ms")}};
    means.commands.Write(out);
  }
}

void NodeFaults::ContinueAll(NodeProcesses& processes) {
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    if (commands_[i].type != "node.pause" || !begun_[i] || ended_[i]) continue;
    ended_[i] = true;
    if (ChildProcess* process = processes.Find(commands_[i].node)) process->Signal(SIGCONT);
  }
}

void NodeFaults::AppendTo(RunLog& log) {
  std::erase_if(log.harness_late, [&](const LateSpan& late) {
    return std::any_of(disturbed_.begin(), disturbed_.end(), [&](const LateSpan& disturbed) {
      return late.begin_ns < disturbed.end_ns && late.end_ns > disturbed.begin_ns;
    });
  });
  const auto& counts = counts_.ActivationCounts();
  log.fault_activation_counts.resize(counts.size(), 0);
  for (std::size_t i = 0; i < counts.size(); ++i) log.fault_activation_counts[i] += counts[i];
  for (auto& activation : counts_.TakeActivations(0)) log.activations.push_back(std::move(activation));
}

}  // namespace tiltproof::harness
