#include "harness/run/realtime/realtime_flight.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "harness/run/flight.h"
#include "harness/run/flown_files.h"
#include "harness/run/realtime/client_parts.h"
#include "harness/run/realtime/ending.h"
#include "harness/run/realtime/injection.h"
#include "harness/run/realtime/log_messages.h"
#include "harness/run/realtime/members.h"
#include "harness/run/realtime/node_faults.h"
#include "harness/run/realtime/node_processes.h"
#include "harness/run/realtime/run_bus.h"
#include "harness/terminal/terminal.h"
#include "link/named.h"

namespace tiltproof::harness {
namespace {

namespace asio = boost::asio;
using SteadyClock = std::chrono::steady_clock;
using dds::NodeKind;
using std::chrono::milliseconds;

constexpr milliseconds kTurn{5};
constexpr milliseconds kFindLimit{10'000};
constexpr milliseconds kCommandLimit{10'000};
// After the end: time for what a partition of the network held up.
constexpr milliseconds kLogLimit{8'000};
constexpr milliseconds kScoreLimit{200};
// A flight that is longer than it should be by this much, on the plant's clock, has come to a stop.
constexpr milliseconds kOverdueLimit{5'000};

struct Interrupted {};

class RealtimeConductor {
 public:
  RealtimeConductor(const Scenario& scenario, const plant::VehicleModel& model,
                    const RealtimeOptions& options);
  RunLog Run();

 private:
  void Conduct();
  void FindNodes();
  void Announce();
  bool HasTakenScenario(const Member& member) const;
  void Prepare();
  void FlyToTheEnd();
  void GatherLogs();

  // One command to all members, and all their answers.
  std::map<std::string, dds::RunAck> Command(dds::RunCommand command, bool tolerate_lost);
  std::map<std::string, dds::RunAck> Command(dds::Verb verb, bool tolerate_lost) {
    return Command({.verb = verb}, tolerate_lost);
  }
  // Turns the loop until `done`; false when the limit is over first. Checks on every turn that everybody lives.
  bool Await(milliseconds limit, const std::function<bool()>& done);
  void Poll();
  void WatchMembers();
  void OnStates();
  TimeNs Now() const;
  TimeNs LostAt(const MemberChange& change) const;
  void Inject();
  NodeFaults::Means MeansOfNodeFaults();
  void Restart(const std::string& role);
  std::string ClientKindFor(const Member& member) const;
  // The client whose node this is; of a line's node the client that it names.
  std::optional<std::size_t> ClientOf(const Member& member, const std::string& named) const;
  // True if the flight goes on without the client, which is then out of it. `lost_ns`: simulation time.
  bool LoseClient(std::optional<std::size_t> client, bool hung, const std::string& text, TimeNs lost_ns);
  void Join(Member& member, const std::string& id, const dds::Participant& participant);

  void End(EndReason reason, const std::string& text) { ending_.End(reason, text, sim_ns_); }
  void Note(const std::string& kind, const std::string& text) {
    collector_.log().Write({sim_ns_, {}, record::Event{kind, text}});
  }
  Scenario scenario_;  // and what is injected
  const plant::VehicleModel& model_;
  const RealtimeOptions& options_;
  const std::string& run_id_ = options_.place.run_id;
  asio::io_context loop_{1};
  // Without work the loop would return at once, and a turn take all of a core.
  asio::executor_work_guard<asio::io_context::executor_type> work_ = asio::make_work_guard(loop_);
  const std::function<void()> wake_ = [this] { asio::post(loop_, [] {}); };
  RunBus bus_{options_, wake_};
  LogCollector collector_{bus_.bus, bus_.circle, scenario_, model_.signals(), run_id_, wake_};
  std::optional<NodeProcesses> processes_;

  NodeFaults node_faults_{scenario_, options_.attach};
  Injector injector_{options_.injections};
  Members members_;
  std::map<std::string, std::map<std::int64_t, dds::RunAck>> answers_;
  std::int64_t command_sequence_ = 0;
  int restart_count_ = 0;
  std::vector<dds::Port> ports_;        // that the link offers
  std::set<std::size_t> lost_clients_;  // without which the flight goes on
  std::int64_t turn_count_ = 0;

  bool running_ = false;
  bool stopping_ = false, releasing_ = false;
  bool injecting_ = false;  // a command waits for the nodes that hear of a fault
  TimeNs sim_ns_ = 0;
  SteadyClock::time_point sim_seen_;
  SteadyClock::time_point started_;
  Ending ending_;
};

RealtimeConductor::RealtimeConductor(const Scenario& scenario, const plant::VehicleModel& model,
                                     const RealtimeOptions& options)
    : scenario_(scenario), model_(model), options_(options) {
  if (!options.attach) processes_.emplace(scenario_, options_, bus_.bus.participant(), node_faults_.loss());
}

RunLog RealtimeConductor::Run() {
  const auto began = SteadyClock::now();
  auto flown = began;
  try {
    try {
      Conduct();
    } catch (const std::exception& error) {
      End(EndReason::kHarnessError, error.what());
    }
    flown = SteadyClock::now();
    // Also after a failure: attached nodes must be free again, and the logs that exist show what went wrong.
    GatherLogs();
  } catch (const Interrupted&) {
    flown = SteadyClock::now();
    ending_.Interrupt(sim_ns_);
    try {
      GatherLogs();
    } catch (const std::exception&) {
      // The logs that have come are kept.
    }
  } catch (const std::exception& error) {
    End(EndReason::kHarnessError, error.what());
  }
  if (processes_) processes_->StopAll();

  const bool completed = ending_.reason() == EndReason::kCompleted;
  node_faults_.WriteTo(collector_.log());
  collector_.log().Write(
      {completed ? scenario_.end_ns() : ending_.end_ns(),
       {},
       record::End{.reason = ending_.reason(),
                   .text = ending_.text(),
                   .wall_s = std::chrono::duration<double>(flown - (running_ ? started_ : began)).count()}});
  RunLog log = collector_.Take();
  log.hover_input = model_.HoverInput();
  log.input_min = model_.InputMin();
  log.input_max = model_.InputMax();
  node_faults_.Excuse(log);
  CountLateness(log, scenario_.link.protocol->control_period_ns);
  TellPlace(log, options_.place);
  if (options_.score) {
    dds::Score score = options_.score(log);
    score.run_id = run_id_;
    dds::Publisher<dds::Score> scores(bus_.bus);
    scores.Write(score);
    scores.WaitForAcks(kScoreLimit.count() * kNsPerMs);
  }
  return log;
}

void RealtimeConductor::Conduct() {
  if (processes_) processes_->StartAll();
  FindNodes();
  Prepare();
  Command({.verb = dds::Verb::kArm, .ports = ports_}, false);
  if (ending_.ended()) return;
  started_ = sim_seen_ = SteadyClock::now();
  // Bytes from before do not count, and a board says `start` but once. An emulator's socket is connected only now.
  for (const ClientSpec& client : options_.clients)
    if (const auto* board = std::get_if<SerialBoard>(&client);
        !options_.attach && board != nullptr && board->reset.empty() && !board->device.starts_with("unix:"))
      Print(stderr, "tiltproof: listening to the board for {:g} s: switch it on, or reset it, now\n",
            ToSeconds(scenario_.duration_ns));
  Command(dds::Verb::kStart, false);
  FlyToTheEnd();
}

// Every node that a run needs, by what it says of itself.
void RealtimeConductor::FindNodes() {
  std::string missing;
  std::vector<SoughtClient> clients;
  for (std::size_t client = 0; client < scenario_.client_count(); ++client)
    clients.push_back({.id = scenario_.has_several_clients() ? scenario_.client_id(client) : "",
                       .has_node = AbilitiesOf(options_.clients.at(client), true).node});
  std::vector<SoughtLine> lines;
  for (const LineEntry& line : scenario_.lines)
    lines.push_back({.id = line.id,
                     .clients = {scenario_.FindClient(line.between[0]).value(),
                                 scenario_.FindClient(line.between[1]).value()}});
  const bool found = Await(kFindLimit, [&] {
    // One that ended while it began has printed why.
    return ending_.ended() || members_.Adopt(bus_.nodes.Nodes(), processes_ ? &*processes_ : nullptr, clients,
                                             lines, run_id_, missing);
  });
  if (ending_.ended()) throw std::runtime_error(ending_.text());
  if (!found)
    throw std::runtime_error(fmt::format(
        "no {} was heard within {} s{}", missing, kFindLimit.count() / 1000,
        options_.attach ? fmt::format("; start it with `tiltproof node ...` on domain {} and look at "
                                      "`tiltproof doctor`, --interface and --peers",
                                      options_.place.domain)
                        : ""));
  members_.CheckHosts();
  for (const Member& member : members_.all()) bus_.circle.Admit(member.participant, member.id);
}

void RealtimeConductor::Announce() {
  dds::RunScenario announcement;
  announcement.run_id = run_id_;
  announcement.scenario_yaml = options_.scenario_yaml;
  for (const Member& member : members_.all()) {
    announcement.nodes.push_back(member.id);
    announcement.participants.push_back(ToText(member.participant));
  }
  for (FlownFile& file : FlownFiles(scenario_)) {
    announcement.files.push_back(std::move(file.what));
    announcement.file_hashes.push_back(std::move(file.hash));
  }
  bus_.scenarios.Write(announcement);
}

bool RealtimeConductor::HasTakenScenario(const Member& member) const {
  const auto nodes = bus_.nodes.Nodes();
  return std::any_of(nodes.begin(), nodes.end(), [&](const dds::NodeLife& node) {
    return node.participant == member.participant && node.last.run_id == run_id_;
  });
}

void RealtimeConductor::Prepare() {
  Announce();
  const bool taken = Await(kCommandLimit, [&] {
    return std::all_of(members_.all().begin(), members_.all().end(),
                       [&](const Member& member) { return HasTakenScenario(member); });
  });
  if (!taken) throw std::runtime_error("a node did not take the scenario within 10 s");
  std::map<std::string, dds::RunAck> answers;
  if (scenario_.has_several_clients()) {
    for (const Member& member : members_.all())
      answers.merge(Command(
          {.node_id = member.id, .verb = dds::Verb::kPrepare, .client_kind = ClientKindFor(member)}, false));
  } else {
    answers =
        Command({.verb = dds::Verb::kPrepare, .client_kind = ClientKindFor(members_.all().front())}, false);
  }
  for (const Member& member : members_.all())
    if (member.kind == NodeKind::kLink || member.kind == NodeKind::kLine)
      ports_.insert(ports_.end(), answers[member.id].ports.begin(), answers[member.id].ports.end());
  // On another host the paths of pseudo-terminals mean nothing: then references go over the bus.
  if (members_.reference_sender().host != members_.Find(NodeKind::kLink)->host)
    std::erase_if(ports_, [](const dds::Port& port) { return port.name.starts_with("base_station"); });
}

// Kind of the member's client, or of the only one; empty: not known. Of a line those at its two ends.
std::string RealtimeConductor::ClientKindFor(const Member& member) const {
  const auto kind_of = [&](std::size_t place) {
    const Member* client = members_.Find(NodeKind::kClient, place);
    return client != nullptr && client->client ? std::string(KindOf(*client->client)) : std::string();
  };
  if (member.kind != NodeKind::kLine) return kind_of(member.place);
  const std::vector<std::string>& between = scenario_.lines.at(member.place).between;
  return kind_of(scenario_.FindClient(between[0]).value()) + "," +
         kind_of(scenario_.FindClient(between[1]).value());
}

std::map<std::string, dds::RunAck> RealtimeConductor::Command(dds::RunCommand command, bool tolerate_lost) {
  command.run_id = run_id_;
  command.sequence = ++command_sequence_;
  const std::string& only = command.node_id;
  bus_.commands.Write(command);
  const auto answered = [&](const Member& member) {
    return (!only.empty() && member.id != only) || (tolerate_lost && member.lost) ||
           answers_[member.id].contains(command.sequence);
  };
  const bool all = Await(kCommandLimit, [&] {
    return (ending_.ended() && !tolerate_lost) ||
           std::all_of(members_.all().begin(), members_.all().end(), answered);
  });
  std::map<std::string, dds::RunAck> answers;
  for (const Member& member : members_.all()) {
    if (!only.empty() && member.id != only) continue;
    const auto found = answers_[member.id].find(command.sequence);
    if (found == answers_[member.id].end()) {
      if (!all && !member.lost && !ending_.ended())
        End(EndReason::kNodeLost, fmt::format("the {} node did not answer `{}` within {} s", member.id,
                                              Name(command.verb), kCommandLimit.count() / 1000));
      continue;
    }
    // A firmware that crashes while it is loaded tells so itself, once the flight has begun; this is ours.
    if (!found->second.ok && !ending_.ended())
      End(EndReason::kHarnessError,
          fmt::format("the {} node cannot {}: {}", member.id, Name(command.verb), found->second.text));
    answers.emplace(member.id, found->second);
  }
  if (ending_.ended() && !tolerate_lost) throw std::runtime_error(ending_.text());
  return answers;
}

bool RealtimeConductor::Await(milliseconds limit, const std::function<bool()>& done) {
  const auto until = SteadyClock::now() + limit;
  while (!done()) {
    if (SteadyClock::now() >= until) return false;
    Poll();
  }
  return true;
}

void RealtimeConductor::Poll() {
  if (options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed) &&
      (!ending_.ended() || ending_.reason() != EndReason::kInterrupted))
    throw Interrupted{};
  bus_.Beat(SteadyClock::now());
  loop_.run_one_for(kTurn);
  loop_.poll();
  bus_.nodes.Take();
  for (auto& ack : bus_.acks.Take())
    if (ack.run_id == run_id_) answers_[ack.node_id][ack.sequence] = std::move(ack);
  for (const auto& state : bus_.plant_states.Take()) {
    if (state.run_id != run_id_) continue;
    sim_ns_ = std::max(sim_ns_, state.time_ns);
    sim_seen_ = SteadyClock::now();
  }
  // Some nanoseconds more on every turn: who watches sees that this process lives, even while the flight does
  // not go on.
  if (options_.progress_ns != nullptr)
    options_.progress_ns->store(sim_ns_ + ++turn_count_ % kNsPerUs, std::memory_order_relaxed);
  collector_.Drain(std::min(sim_ns_, scenario_.end_ns()));
  if (!collector_.overfull().empty()) End(EndReason::kHarnessError, collector_.overfull());
  OnStates();
  WatchMembers();
  ending_.Settle(SteadyClock::now(), members_.AnySilent());
  // A paused node answers when its pause is over.
  if (injecting_) node_faults_.EndPauses(Now(), MeansOfNodeFaults());
}

void RealtimeConductor::OnStates() {
  for (const auto& state : bus_.states.Take()) {
    if (state.run_id != run_id_) continue;
    const bool of_plant = state.node_id == members_.Find(NodeKind::kPlant)->id;
    const auto reason = FindNamed<EndReason>(state.end_reason);
    if (of_plant && state.origin_ns != 0) running_ = true;
    if (of_plant && state.phase == dds::Phase::kFinished && state.origin_ns != 0) {
      ending_.Believe();
      if (reason == EndReason::kCompleted || reason == EndReason::kDiverged ||
          reason == EndReason::kGroundStrike)
        ending_.End(*reason, state.text, state.time_ns);
    }
    const auto member = std::find_if(members_.all().begin(), members_.all().end(),
                                     [&](const Member& each) { return each.id == state.node_id; });
    const bool of_node =
        reason && (WentAway(*reason) || reason == EndReason::kNodeLost || reason == EndReason::kLineOverfull);
    if (state.phase == dds::Phase::kFailed && of_node &&
        (member == members_.all().end() ||
         !LoseClient(ClientOf(*member, state.client_id), *reason == EndReason::kFirmwareHung, state.text,
                     sim_ns_)))
      ending_.Hear(*reason, fmt::format("{} (at {:.3f} s)", state.text, ToSeconds(sim_ns_)), sim_ns_,
                   SteadyClock::now());
  }
}

std::optional<std::size_t> RealtimeConductor::ClientOf(const Member& member, const std::string& named) const {
  if (member.kind == NodeKind::kLine) return scenario_.FindClient(named);
  const bool of_client = member.kind == NodeKind::kClient || member.kind == NodeKind::kLink;
  return of_client ? std::optional(member.place) : std::nullopt;
}

bool RealtimeConductor::LoseClient(std::optional<std::size_t> client, bool hung, const std::string& text,
                                   TimeNs lost_ns) {
  // A client that cannot even begin ends the flight, as the others do.
  if (!client || !running_ || !MayLose(scenario_, *client)) return false;
  if (lost_clients_.insert(*client).second) {
    collector_.log().Write(
        {sim_ns_, client, record::Event{hung ? kClientHungEvent : kClientCrashedEvent, text}});
    collector_.log().Write(
        {sim_ns_, client,
         record::ClientEnd{.loss = ClientLoss{.time_ns = lost_ns, .hung = hung, .text = text, .end = {}}}});
  }
  return lost_clients_.size() < scenario_.client_count();
}

void RealtimeConductor::WatchMembers() {
  for (const std::string& stranger : members_.NewStrangers(bus_.nodes.Nodes(), run_id_)) {
    Print(stderr, "warning: {}\n", stranger);
    Note("node_ignored", stranger);
  }
  // While they load a scenario, open ports or look at a firmware that never started, the limit of a command is theirs.
  const bool flying = started_ != SteadyClock::time_point{} && !stopping_;
  for (const MemberChange& change : members_.Watch(
           flying ? bus_.nodes.Nodes() : std::vector<dds::NodeLife>{}, processes_ ? &*processes_ : nullptr,
           node_faults_.excused(), node_faults_.paused(), SteadyClock::now())) {
    // Released, they go.
    if (releasing_) continue;
    switch (change.kind) {
      case MemberChange::Kind::kSilent:
        Note("node_silent", change.text);
        break;
      case MemberChange::Kind::kBack:
        Note("node_back", change.text);
        break;
      case MemberChange::Kind::kLost: {
        const std::string text = fmt::format("{} (at {:.3f} s)", change.text, ToSeconds(sim_ns_));
        const Member* member = members_.FindRole(change.role);
        if (member != nullptr && member->kind == NodeKind::kClient &&
            LoseClient(member->place, change.hung, change.text, LostAt(change)))
          break;
        Note("node_lost", text);
        End(change.firmware ? EndReason::kFirmwareLost : EndReason::kNodeLost, text);
        break;
      }
    }
  }
}

void RealtimeConductor::FlyToTheEnd() {
  const std::chrono::nanoseconds duration(scenario_.end_ns()), start_wait(scenario_.start_wait_ns());
  while (!ending_.ended()) {
    Poll();
    Inject();
    if (running_) node_faults_.CarryOut(Now(), MeansOfNodeFaults());
    const auto now = SteadyClock::now();
    if (ending_.ended()) break;
    if (!running_ && now - started_ > start_wait) {
      End(EndReason::kNeverStarted, NeverStartedText(scenario_));
    } else if (running_ && now - started_ > start_wait + 2 * duration + kOverdueLimit) {
      End(EndReason::kNodeLost, fmt::format("the flight came to a stop at {:.3f} s", ToSeconds(sim_ns_)));
    }
  }
}

// The plant's word is up to a period old: by this clock it is exact.
TimeNs RealtimeConductor::Now() const {
  return sim_ns_ +
         std::min<TimeNs>(std::chrono::nanoseconds(SteadyClock::now() - sim_seen_).count(), kNsPerS);
}

// A client is judged until then: it is known to be lost seconds after it fell silent.
TimeNs RealtimeConductor::LostAt(const MemberChange& change) const {
  if (!change.heard_last) return sim_ns_;
  const std::chrono::nanoseconds since = SteadyClock::now() - *change.heard_last;
  return std::max<TimeNs>(Now() - since.count(), 0);
}

void RealtimeConductor::Inject() {
  const auto tell = [this](const AddedFault& fault) {
    injecting_ = true;
    const auto answers =
        Command({.verb = dds::Verb::kInject,
                 .faults = std::vector<dds::InjectedFault>{{fault.text, fault.id, fault.start_ns}}},
                false);
    injecting_ = false;
    std::vector<TimeNs> begins;
    for (const auto& [node, ack] : answers)
      begins.insert(begins.end(), ack.begins_ns.begin(), ack.begins_ns.end());
    return begins;
  };
  if (const auto event = injector_.Poll(scenario_, running_, Now(), tell))
    collector_.log().Write({event->time_ns, {}, record::Event{event->kind, event->text}});
}

NodeFaults::Means RealtimeConductor::MeansOfNodeFaults() {
  return {.run_id = run_id_,
          .processes = processes_ ? &*processes_ : nullptr,
          .members = members_,
          .commands = bus_.fault_commands,
          .restart = [this](const std::string& role) { Restart(role); },
          .note = [this](const std::string& kind, const std::string& text) { Note(kind, text); }};
}

// The new process joins the run as the old one did: told the scenario, prepared, armed, started. It is another
// participant, with a name of its own, and so a log of its own.
void RealtimeConductor::Restart(const std::string& role) {
  Member& member = *members_.FindRole(role);
  const std::string id = fmt::format("{}-{}", role, ++restart_count_ + 1);
  processes_->Start(role, id);
  if (member.kind == NodeKind::kClient)
    collector_.log().Write({sim_ns_, Whose(scenario_, member.place),
                            record::Event{kResetEvent, "started again as a new process"}});
  bool joined = false;
  const bool back = Await(kCommandLimit, [&] {
    const auto participant = processes_->ParticipantOf(role);
    if (participant && !joined) Join(member, id, *participant);
    joined = participant.has_value();
    return ending_.ended() || (joined && HasTakenScenario(member));
  });
  if (!back) End(EndReason::kNodeLost, fmt::format("the {} node did not come back", role));
  for (const dds::Verb verb : {dds::Verb::kPrepare, dds::Verb::kArm, dds::Verb::kStart}) {
    if (ending_.ended()) return;
    Command({.node_id = member.id, .verb = verb, .ports = ports_, .client_kind = ClientKindFor(member)},
            true);
  }
}

void RealtimeConductor::Join(Member& member, const std::string& id, const dds::Participant& participant) {
  members_.Replace(member, id, participant);
  bus_.circle.Admit(participant, id);
  Announce();
}

// Every node hands in its log. Records that a partition held back come when the partition ends.
void RealtimeConductor::GatherLogs() {
  if (command_sequence_ < 3) {
    // Not even started: there is no log.
    if (command_sequence_ > 0) Command(dds::Verb::kRelease, true);
    return;
  }
  if (processes_) {
    node_faults_.ContinueAll(*processes_);
    // A node that a fault has just killed, to start it again, sends nothing more.
    for (Member& member : members_.all())
      if (ChildProcess* process = processes_->Find(member.role); process != nullptr && !process->Alive())
        member.lost = true;
  }
  stopping_ = true;
  Command(dds::Verb::kStop, true);
  const auto complete = [&] {
    return std::all_of(members_.all().begin(), members_.all().end(),
                       [&](const Member& m) { return m.lost || collector_.Complete(m.id); });
  };
  if (!Await(kLogLimit, complete)) {
    for (const Member& member : members_.all())
      if (!member.lost && !collector_.Complete(member.id))
        End(EndReason::kNodeLost, fmt::format("the log of the {} node is not whole: {} missing", member.id,
                                              collector_.Missing(member.id)));
  }
  releasing_ = true;
  Command(dds::Verb::kRelease, true);
}

}  // namespace

RunLog FlyRealtime(const Scenario& scenario, const plant::VehicleModel& model,
                   const RealtimeOptions& options) {
  return RealtimeConductor(scenario, model, options).Run();
}

}  // namespace tiltproof::harness
