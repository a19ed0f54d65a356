#include "harness/run/realtime/node_faults.h"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <stdexcept>
#include <utility>

#include "harness/run/realtime/client_parts.h"
#include "harness/run/realtime/node_order.h"
#include "link/overloaded.h"

namespace tiltproof::harness {
namespace {

// The plant's word on the time is up to a period old.
constexpr TimeNs kBeforeNs = 50 * kNsPerMs;
constexpr TimeNs kRecoveryNs = kNsPerS;
// A node that is cut off for good comes back after the longest flight.
constexpr TimeNs kForGoodNs = 3600 * kNsPerS;

bool ActsOnProcess(const faults::NodeAction& action) {
  return std::visit(
      Overloaded{
          [](const faults::KillNode&) { return true; }, [](const faults::PauseNode&) { return true; },
          [](const faults::RestartNode&) { return true; }, [](const faults::PartitionNode&) { return false; },
          [](const faults::LosePackets&) { return false; }, [](const faults::DriftClock&) { return false; },
          [](const faults::JumpClock&) { return false; }},
      action);
}

// With several clients, the nodes of the clients that a fault means.
std::vector<faults::NodeCommand> CommandsOfParts(const Scenario& scenario) {
  std::vector<faults::NodeCommand> commands;
  for (const faults::NodeCommand& command : faults::NodeCommands(scenario.faults)) {
    const std::string& whose = scenario.faults[command.fault].client;
    if (command.node != "client" && command.node != "link") {
      commands.push_back(command);
      continue;
    }
    for (std::size_t client = 0; client < scenario.client_count(); ++client) {
      if (!whose.empty() && whose != scenario.client_id(client)) continue;
      commands.push_back(command);
      commands.back().node = PartName(scenario, command.node, client);
    }
  }
  return commands;
}

}  // namespace

NodeFaults::NodeFaults(const Scenario& scenario, bool attached)
    : scenario_(scenario),
      commands_(CommandsOfParts(scenario)),
      begun_(commands_.size(), false),
      ended_(commands_.size(), false),
      counts_(scenario.faults, scenario.seed, {.protocol = scenario.link.protocol}) {
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    const faults::NodeCommand& command = commands_[i];
    const std::string& id = scenario.faults[command.fault].id;
    const auto* loss = std::get_if<faults::LosePackets>(&command.action);
    if (attached && loss != nullptr)
      throw std::runtime_error(fmt::format(
          "fault '{}': attached nodes have joined the bus already; start them with --xmit-loss", id));
    if (attached && ActsOnProcess(command.action))
      throw std::runtime_error(
          fmt::format("fault '{}': {} needs nodes that the harness starts itself, not attached ones", id,
                      scenario.faults[command.fault].type));
    if (loss == nullptr) continue;
    // It is set when the node joins, once and for all.
    begun_[i] = ended_[i] = true;
    loss_[command.node] = loss->probability;
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

void NodeFaults::EndPauses(TimeNs now_ns, const Means& means) {
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    if (!std::holds_alternative<faults::PauseNode>(commands_[i].action) || !begun_[i] || ended_[i] ||
        now_ns < commands_[i].until_ns)
      continue;
    ended_[i] = true;
    Apply(commands_[i], false, now_ns, means);
  }
}

void NodeFaults::Apply(const faults::NodeCommand& command, bool begin, TimeNs now_ns, const Means& means) {
  const std::string& node = command.node;
  const faults::FaultSpec& fault = scenario_.faults[command.fault];
  const auto process = [&]() -> ChildProcess& {
    ChildProcess* found = means.processes != nullptr ? means.processes->Find(node) : nullptr;
    if (found != nullptr) return *found;
    throw std::runtime_error(
        fmt::format("fault '{}': there is no {} node for {}", fault.id, node, fault.type));
  };
  const std::string what = std::visit(
      Overloaded{[&](const faults::KillNode&) {
                   process().Signal(SIGKILL);
                   return "killed";
                 },
                 [&](const faults::PauseNode&) {
                   process().Signal(begin ? SIGSTOP : SIGCONT);
                   begin ? (void)paused_.insert(node) : (void)paused_.erase(node);
                   return begin ? "stopped" : "continued";
                 },
                 [&](const faults::RestartNode&) {
                   if (begin) {
                     process().Signal(SIGKILL);
                     excused_.insert(node);
                   } else {
                     means.restart(node);
                     excused_.erase(node);
                   }
                   return begin ? "killed, to be started again" : "started again";
                 },
                 [&](const faults::PartitionNode&) {
                   if (begin) {
                     excused_.insert(node);
                     const bool for_good = command.until_ns == kNever;
                     Send(command, LeaveBus{for_good ? kForGoodNs : command.until_ns - command.at_ns}, means);
                   } else {
                     excused_.erase(node);
                   }
                   return begin ? "cut off the bus" : "on the bus again";
                 },
                 // Set when the nodes joined.
                 [](const faults::LosePackets&) { return "loses packets"; },
                 [&](const faults::DriftClock& drift) {
                   Send(command, SetClockRate{begin ? drift.ppm : 0.0}, means);
                   return begin ? "clock at a wrong rate" : "clock at its true rate";
                 },
                 [&](const faults::JumpClock& jump) {
                   Send(command, JumpClock{begin ? jump.by_ns : -jump.by_ns}, means);
                   return begin ? "clock jumped" : "clock jumped back";
                 }},
      command.action);
  means.note(fault.type, fmt::format("{}: {} {}", fault.id, node, what));
  if (begin) counts_.Count(command.fault, now_ns, node + " " + what);
  disturbed_.push_back({now_ns - kBeforeNs, now_ns + kRecoveryNs});
  if (!begin) disturbed_.back().begin_ns = command.at_ns - kBeforeNs;
}

void NodeFaults::Send(const faults::NodeCommand& command, const NodeOrder& order, const Means& means) {
  for (const Member& member : means.members.all()) {
    if (command.node != "all" && member.part != command.node) continue;
    dds::FaultCommand out = ToMessage(order);
    out.run_id = means.run_id;
    out.node_id = member.id;
    out.sequence = ++sequence_;
    out.fault_id = scenario_.faults[command.fault].id;
    means.commands.Write(out);
  }
}

void NodeFaults::ContinueAll(NodeProcesses& processes) {
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    if (!std::holds_alternative<faults::PauseNode>(commands_[i].action) || !begun_[i] || ended_[i]) continue;
    ended_[i] = true;
    if (ChildProcess* process = processes.Find(commands_[i].node)) process->Signal(SIGCONT);
  }
}

void NodeFaults::WriteTo(RecordSink& sink) {
  for (faults::Activation& activation : counts_.TakeActivations({})) {
    const TimeNs time_ns = activation.time_ns;
    sink.Write({time_ns, {}, std::move(activation)});
  }
  sink.Write({0, {}, record::ActivationCounts{counts_.ActivationCounts()}});
}

void NodeFaults::Excuse(RunLog& log) const {
  std::erase_if(log.harness_late, [&](const LateSpan& late) {
    return std::any_of(disturbed_.begin(), disturbed_.end(), [&](const LateSpan& disturbed) {
      return late.begin_ns < disturbed.end_ns && late.end_ns > disturbed.begin_ns;
    });
  });
}

}  // namespace tiltproof::harness
