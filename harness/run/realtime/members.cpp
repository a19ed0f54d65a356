#include "harness/run/realtime/members.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "harness/process/own_time.h"

namespace tiltproof::harness {
namespace {

using dds::NodeKind;
using std::chrono::duration_cast;
using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

}  // namespace

bool Members::Adopt(const std::vector<dds::NodeLife>& nodes, NodeProcesses* processes, bool board,
                    const std::string& run_id, std::string& missing) {
  members_.clear();
  std::string instead;
  // In the order of node ids.
  for (const auto& node : nodes) {
    if (!node.alive || node.last.kind == NodeKind::kHarness || node.last.kind == NodeKind::kMonitor) continue;
    if (processes != nullptr && processes->ParticipantOf(node.last.node_id) != node.participant) continue;
    if (FindPlaceOf(node.last.kind) != nullptr) continue;
    if (node.last.version != TILTPROOF_VERSION) {
      instead = fmt::format("node of this version {}: {} has version {}", TILTPROOF_VERSION,
                            node.last.node_id, node.last.version);
      continue;
    }
    if (!node.last.run_id.empty() && node.last.run_id != run_id) {
      instead = fmt::format("free node: {} is in another run", node.last.node_id);
      continue;
    }
    Member& member = members_.emplace_back();
    member.id = member.role = node.last.node_id;
    member.participant = node.participant;
    member.kind = node.last.kind;
    member.host = node.last.host;
    for (const std::string_view capability : node.last.capabilities)
      if (constexpr std::string_view kClient = "client="; capability.starts_with(kClient))
        member.client = ClientOfKind(capability.substr(kClient.size()));
    board |= member.client && std::holds_alternative<SerialBoard>(*member.client);
  }
  missing.clear();
  const auto need = [&](NodeKind kind, const char* what) {
    if (FindPlaceOf(kind) == nullptr) missing += fmt::format("{}{}", missing.empty() ? "" : " and no ", what);
  };
  need(NodeKind::kPlant, "plant node");
  need(NodeKind::kLink, "link node");
  if (!board) need(NodeKind::kClient, "client node");
  need(NodeKind::kBaseStation, "base-station or joystick node");
  if (!instead.empty() && !missing.empty()) missing = instead;
  return missing.empty();
}

// Base station and joystick have one place: that of who sends references.
const Member* Members::FindPlaceOf(NodeKind kind) const {
  const auto place = [](NodeKind k) { return k == NodeKind::kJoystick ? NodeKind::kBaseStation : k; };
  for (const Member& member : members_)
    if (place(member.kind) == place(kind)) return &member;
  return nullptr;
}

void Members::Replace(Member& member, const std::string& id, const dds::Participant& participant) {
  strangers_.insert(member.participant);  // the dead one may be heard for a moment, and its end is no change
  member.id = id;
  member.participant = participant;
}

std::vector<std::string> Members::NewStrangers(const std::vector<dds::NodeLife>& nodes,
                                               const std::string& run_id) {
  std::vector<std::string> strangers;
  for (const auto& node : nodes) {
    const dds::Heartbeat& said = node.last;
    const Member* member = FindPlaceOf(said.kind);
    const bool of_another_run = !said.run_id.empty() && said.run_id != run_id;
    if (!node.alive || member == nullptr || of_another_run || strangers_.size() >= kStrangersMax) continue;
    const bool is_member = std::any_of(members_.begin(), members_.end(),
                                       [&](const Member& m) { return m.participant == node.participant; });
    if (is_member || !strangers_.insert(node.participant).second) continue;
    strangers.push_back(fmt::format("the {} node {} on {} (process {}) is ignored: this flight has {}",
                                    Name(said.kind), said.node_id, said.host, said.pid, member->id));
  }
  return strangers;
}

void Members::CheckHosts() const {
  const Member& link = *Find(NodeKind::kLink);
  for (const NodeKind kind : {NodeKind::kPlant, NodeKind::kClient}) {
    const Member* member = Find(kind);
    if (member != nullptr && member->host != link.host)
      throw std::runtime_error(fmt::format(
          "the {} node runs on {} and the link node on {}: they share a serial line, so both must run "
          "on one host",
          Name(kind), member->host, link.host));
  }
}

std::vector<MemberChange> Members::Watch(const std::vector<dds::NodeLife>& nodes, NodeProcesses* processes,
                                         const std::set<std::string>& excused,
                                         const std::set<std::string>& paused, SteadyClock::time_point now) {
  std::vector<MemberChange> changes;
  const auto is_excused = [&](const std::string& role) {
    return excused.contains(role) || excused.contains("all");
  };
  if (processes != nullptr) LoseEnded(*processes, is_excused, changes);
  for (Member& member : members_) member.kept_away = is_excused(member.role);
  for (Member& member : members_) {
    if (member.lost) continue;
    const auto found = std::find_if(nodes.begin(), nodes.end(), [&](const dds::NodeLife& node) {
      return node.participant == member.participant;
    });
    const bool heard = found == nodes.end() || found->alive;
    if (heard) {
      if (member.silent_since)
        changes.push_back({MemberChange::Kind::kBack, member.role, false,
                           fmt::format("the {} node is heard again after {} ms", member.id,
                                       duration_cast<milliseconds>(now - *member.silent_since).count())});
      member.silent_since.reset();
      member.silent_for.reset();
      continue;
    }
    if (!member.silent_since) {
      member.silent_since = now;
      changes.push_back({MemberChange::Kind::kSilent, member.role, false,
                         fmt::format("the {} node missed its lease of 200 ms", member.id)});
    }
    JudgeSilent(member, processes != nullptr ? processes->Find(member.role) : nullptr, paused, now, changes);
  }
  return changes;
}

void Members::LoseEnded(NodeProcesses& processes, const std::function<bool(const std::string&)>& is_excused,
                        std::vector<MemberChange>& changes) {
  for (const auto& name : processes.names()) {
    ChildProcess* process = processes.Find(name);
    if (process == nullptr || process->Alive() || is_excused(name)) continue;
    // Not yet a member when it ends while it begins.
    Member unknown;
    unknown.id = name;
    Member* member = FindRole(name);
    Lose(member != nullptr ? *member : unknown, process->ExitText().value_or("has ended"), changes);
  }
}

void Members::JudgeSilent(Member& member, ChildProcess* process, const std::set<std::string>& paused,
                          SteadyClock::time_point now, std::vector<MemberChange>& changes) {
  // A program, an emulator or a board is not its node, which is a process of ours.
  const bool holds_firmware = !member.client || std::holds_alternative<HostLibrary>(*member.client);
  const bool kept_away = member.kept_away;
  // It has to be heard again before long, not at once.
  if (kept_away) member.silent_for.reset();
  // While it is down, to be started again, it has all the time it needs.
  if (kept_away && process != nullptr && !process->Alive()) return;
  if (process != nullptr && !kept_away) {
    if (!member.silent_for) member.silent_for.emplace(process->pid());
    const std::chrono::nanoseconds silent_for{member.silent_for->Look(now)};
    // A busy machine makes a living node look dead for a moment; a stopped one is recognised at once.
    if (IsStopped(process->pid())) {
      // By a fault: a firmware that hangs. By others: the machine's doing.
      const bool itself = HasStoppedItself(process->pid());
      Lose(member,
           itself ? "does not answer: it has stopped itself" : "does not answer: its process is stopped",
           changes, itself || paused.contains(member.role));
    } else if (silent_for > kHangLimit) {
      Lose(member, "does not answer: it hangs", changes, !HostIsSilent(member) && holds_firmware);
    }
  } else if (now - *member.silent_since > kPartitionLimit) {
    Lose(member,
         fmt::format("was not heard for {} s: it ended, hangs or is cut off", kPartitionLimit.count() / 1000),
         changes, !HostIsSilent(member) && holds_firmware);
  }
}

bool Members::HostIsSilent(const Member& member) const {
  return std::any_of(members_.begin(), members_.end(), [&](const Member& other) {
    return &other != &member && other.host == member.host && other.silent_since && !other.kept_away;
  });
}

void Members::Lose(Member& member, const std::string& how, std::vector<MemberChange>& changes, bool blame) {
  if (member.lost) return;
  member.lost = true;
  const bool firmware = blame && member.kind == NodeKind::kClient;
  changes.push_back({MemberChange::Kind::kLost, member.role, firmware,
                     firmware ? fmt::format("the firmware under test is lost: its node {} {}", member.id, how)
                              : fmt::format("the {} node {}", member.id, how)});
}

bool Members::AnySilent() const {
  return std::any_of(members_.begin(), members_.end(), [](const Member& member) {
    return !member.lost && member.silent_since && !member.kept_away;
  });
}

const Member* Members::Find(NodeKind kind) const {
  for (const Member& member : members_)
    if (member.kind == kind) return &member;
  return nullptr;
}

Member* Members::FindRole(const std::string& role) {
  for (Member& member : members_)
    if (member.role == role) return &member;
  return nullptr;
}

const Member& Members::reference_sender() const {
  const Member* base_station = Find(NodeKind::kBaseStation);
  if (base_station != nullptr) return *base_station;
  const Member* joystick = Find(NodeKind::kJoystick);
  if (joystick == nullptr) throw std::logic_error("a run without a node that sends references");
  return *joystick;
}

}  // namespace tiltproof::harness
