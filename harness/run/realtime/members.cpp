#include "harness/run/realtime/members.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "harness/dds/qos.h"
#include "harness/process/own_time.h"

namespace tiltproof::harness {
namespace {

using dds::NodeKind;
using std::chrono::duration_cast;
using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

// Each client has nodes of these kinds.
bool IsOfClient(NodeKind kind) { return kind == NodeKind::kLink || kind == NodeKind::kClient; }

// The text behind such a beginning among the node's capabilities.
std::optional<std::string_view> Capability(const dds::Heartbeat& said, std::string_view beginning) {
  for (const std::string_view capability : said.capabilities)
    if (capability.starts_with(beginning)) return capability.substr(beginning.size());
  return std::nullopt;
}

}  // namespace

bool Members::Adopt(const std::vector<dds::NodeLife>& nodes, NodeProcesses* processes,
                    const std::vector<SoughtClient>& clients, const std::vector<SoughtLine>& lines,
                    const std::string& run_id, std::string& missing) {
  members_.clear();
  clients_ = clients;
  lines_ = lines;
  std::string instead;
  // In the order of node ids.
  for (const auto& node : nodes) {
    if (!node.alive || node.last.kind == NodeKind::kHarness || node.last.kind == NodeKind::kMonitor) continue;
    if (processes != nullptr && processes->ParticipantOf(node.last.node_id) != node.participant) continue;
    const std::optional<std::size_t> place = PlaceOf(node.last);
    if (!place || FindPlaceOf(node.last.kind, *place) != nullptr) continue;
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
    member.place = *place;
    member.part = Name(node.last.kind);
    if (IsOfClient(node.last.kind) && !clients_[*place].id.empty()) member.part += "-" + clients_[*place].id;
    member.host = node.last.host;
    if (node.last.kind == NodeKind::kLine) member.part += "-" + lines_[*place].id;
    member.has_cable = Capability(node.last, "cable=").has_value();
    for (std::size_t end = 0; end < member.has_device.size(); ++end)
      member.has_device[end] = Capability(node.last, fmt::format("end{}=", end)).has_value();
    if (const auto kind = Capability(node.last, "client=")) member.client = ClientOfKind(*kind);
    if (member.client && std::holds_alternative<SerialBoard>(*member.client))
      clients_[*place].has_node = false;
  }
  missing.clear();
  const auto need = [&](NodeKind kind, std::size_t place, const std::string& what) {
    if (FindPlaceOf(kind, place) == nullptr)
      missing += fmt::format("{}{}", missing.empty() ? "" : " and no ", what);
  };
  const auto need_each = [&](NodeKind kind, const char* what) {
    for (std::size_t place = 0; place < clients_.size(); ++place) {
      if (kind == NodeKind::kClient && !clients_[place].has_node) continue;
      const std::string& id = clients_[place].id;
      need(kind, place, id.empty() ? what : fmt::format("{} of client {} (--id {})", what, id, id));
    }
  };
  need(NodeKind::kPlant, 0, "plant node");
  need_each(NodeKind::kLink, "link node");
  need_each(NodeKind::kClient, "client node");
  for (std::size_t place = 0; place < lines_.size(); ++place)
    need(NodeKind::kLine, place, fmt::format("line node of {0} (--id {0})", lines_[place].id));
  need(NodeKind::kBaseStation, 0, "base-station or joystick node");
  if (!instead.empty() && !missing.empty()) missing = instead;
  return missing.empty();
}

// Base station and joystick have one place: that of who sends references.
const Member* Members::FindPlaceOf(NodeKind kind, std::size_t place) const {
  const auto seat = [](NodeKind k) { return k == NodeKind::kJoystick ? NodeKind::kBaseStation : k; };
  for (const Member& member : members_)
    if (seat(member.kind) == seat(kind) && member.place == place) return &member;
  return nullptr;
}

std::optional<std::size_t> Members::PlaceOf(const dds::Heartbeat& said) const {
  const auto id = Capability(said, "id=");
  if (said.kind == NodeKind::kLine) {
    for (std::size_t place = 0; place < lines_.size(); ++place)
      if (id && lines_[place].id == *id) return place;
    return std::nullopt;
  }
  if (!IsOfClient(said.kind) || clients_.size() < 2) return 0;
  for (std::size_t place = 0; place < clients_.size(); ++place)
    if (id && clients_[place].id == *id) return place;
  return std::nullopt;
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
    const std::optional<std::size_t> place = PlaceOf(said);
    const Member* member = place ? FindPlaceOf(said.kind, *place) : nullptr;
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
  for (const Member& member : members_) {
    if (member.kind == NodeKind::kClient) {
      const Member& own = *Find(NodeKind::kLink, member.place);
      const Member& without = member.has_cable ? own : member;
      if (member.has_cable != own.has_cable)
        throw std::runtime_error(fmt::format(
            "the nodes {} and {} are the ends of one line, and {} has no cable: give both --cable, or none",
            member.id, own.id, without.id));
    }
    if (member.kind == NodeKind::kLine) CheckEnds(member);
    const bool on_line =
        member.kind == NodeKind::kPlant || member.kind == NodeKind::kLine || IsOfClient(member.kind);
    const bool at_far_end = member.kind == NodeKind::kClient && member.has_cable;
    if (on_line && !at_far_end && member.host != link.host)
      throw std::runtime_error(fmt::format(
          "the {} node runs on {} and the {} node on {}: they share a serial line, so both must run "
          "on one host",
          member.part, member.host, link.part, link.host));
  }
}

// A client with cables, or a board, has one of each of its lines, too.
void Members::CheckEnds(const Member& line) const {
  for (std::size_t end = 0; end < line.has_device.size(); ++end) {
    const std::size_t place = lines_[line.place].clients.at(end);
    const Member* client = Find(NodeKind::kClient, place);
    // A board on the ports of its link node.
    const bool has_cable = client == nullptr || client->has_cable;
    if (client == nullptr) client = Find(NodeKind::kLink, place);
    if (has_cable == line.has_device[end]) continue;
    throw std::runtime_error(
        has_cable
            ? fmt::format(
                  "the node {} has cables, and {} has no device for its end of the line: give it --cable "
                  "DEV,DEV, in the order of `between`",
                  client->id, line.id)
            : fmt::format("the node {} has no cables, and {} has a device for its end of the line: put - in "
                          "its place "
                          "in --cable",
                          client->id, line.id));
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
        changes.push_back({MemberChange::Kind::kBack, member.role, false, false,
                           fmt::format("the {} node is heard again after {} ms", member.id,
                                       duration_cast<milliseconds>(now - *member.silent_since).count())});
      member.silent_since.reset();
      member.silent_for.reset();
      continue;
    }
    if (!member.silent_since) {
      member.silent_since = now;
      changes.push_back({MemberChange::Kind::kSilent, member.role, false, false,
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
    Lose(member != nullptr ? *member : unknown, process->ExitText().value_or("has ended"), changes, true,
         false);
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
           changes, itself || paused.contains(member.role), true);
    } else if (silent_for > kHangLimit) {
      Lose(member, "does not answer: it hangs", changes, !HostIsSilent(member) && holds_firmware, true);
    }
  } else if (now - *member.silent_since > kPartitionLimit) {
    Lose(member,
         fmt::format("was not heard for {} s: it ended, hangs or is cut off", kPartitionLimit.count() / 1000),
         changes, !HostIsSilent(member) && holds_firmware, true);
  }
}

bool Members::HostIsSilent(const Member& member) const {
  return std::any_of(members_.begin(), members_.end(), [&](const Member& other) {
    return &other != &member && other.host == member.host && other.silent_since && !other.kept_away;
  });
}

void Members::Lose(Member& member, const std::string& how, std::vector<MemberChange>& changes, bool blame,
                   bool hung) {
  if (member.lost) return;
  member.lost = true;
  const bool firmware = blame && member.kind == NodeKind::kClient;
  changes.push_back({MemberChange::Kind::kLost, member.role, firmware, hung,
                     firmware ? fmt::format("the firmware under test is lost: its node {} {}", member.id, how)
                              : fmt::format("the {} node {}", member.id, how),
                     member.silent_since ? std::optional(*member.silent_since -
                                                         std::chrono::nanoseconds(dds::kHeartbeatLeaseNs))
                                         : std::nullopt});
}

bool Members::AnySilent() const {
  return std::any_of(members_.begin(), members_.end(), [](const Member& member) {
    return !member.lost && member.silent_since && !member.kept_away;
  });
}

const Member* Members::Find(NodeKind kind, std::size_t place) const {
  for (const Member& member : members_)
    if (member.kind == kind && member.place == place) return &member;
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
