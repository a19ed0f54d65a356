#include "harness/node/node.h"

#include <fmt/format.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <chrono>
#include <csignal>
#include <tuple>
#include <utility>

#include "faults/registry.h"
#include "harness/dds/qos.h"
#include "harness/process/affinity.h"
#include "harness/process/realtime_rights.h"
#include "harness/run/flown_files.h"
#include "harness/run/introduction.h"
#include "harness/run/realtime/injection.h"
#include "harness/run/realtime/node_order.h"
#include "harness/run/run_id.h"
#include "harness/terminal/terminal.h"
#include "link/overloaded.h"

namespace tiltproof::harness {
namespace {

namespace asio = boost::asio;
using std::chrono::milliseconds;

constexpr std::chrono::nanoseconds kHeartbeatPeriod{dds::kHeartbeatPeriodNs};
constexpr std::int64_t kYoungBeats = 2 * kNsPerS / dds::kHeartbeatPeriodNs;
// Time in which a node that runs already is heard.
constexpr milliseconds kListenFirst{1'000};
// A harness that is silent for this long is gone for good; a partition of the network heals sooner.
constexpr milliseconds kHarnessLostAfter{6000};

// "library", or "library,qemu" for the ends of a line.
ClientKinds KindsNamed(std::string_view kinds) {
  ClientKinds named;
  for (std::size_t comma = 0; comma != kinds.npos;) {
    comma = kinds.find(',');
    named.push_back(ClientOfKind(kinds.substr(0, comma)));
    kinds.remove_prefix(comma == kinds.npos ? kinds.size() : comma + 1);
  }
  return named;
}

class Node final : public NodeServices {
 public:
  Node(const NodeOptions& options, const MakeRole& make_role);
  int Run();

  asio::io_context& loop() override { return loop_; }
  dds::Bus& bus() override { return *bus_; }
  NodeClock& clock() override { return clock_; }
  const std::string& run_id() const override { return run_id_; }
  const dds::Circle& members() const override { return members_; }
  RecordSink& log() override { return *log_; }
  Lateness& lateness() override { return lateness_; }
  void SetPhase(dds::Phase phase, TimeNs time_ns, Origin origin, EndReason reason,
                const std::string& text) override;
  void FailClient(const std::string& client_id, EndReason reason, const std::string& text) override;
  void TellRole(std::uint32_t role) override;

 private:
  // Something arrived: look in the loop's thread.
  std::function<void()> Posted(void (Node::*look)()) {
    return [this, look] { asio::post(loop_, [this, look] { (this->*look)(); }); };
  }
  std::string OtherSender();
  bool StandsBack();
  void Beat();
  void OnScenario();
  // The scenario names this very process.
  bool NamesUs(const dds::RunScenario& scenario) const;
  void MeetMembers(const dds::RunScenario& scenario);
  void ForgetReleasedRun();
  void OnCommand();
  void OnFault();
  void Obey(const dds::RunCommand& command);
  void Do(const dds::RunCommand& command, dds::RunAck& ack);
  std::optional<TimeNs> Inject(AddedFault fault);
  void WatchHarness();
  void Release();
  // Tells the bus where this node stands.
  void Tell(dds::Phase phase);
  bool flying() const { return phase_ == dds::Phase::kRunning; }

  NodeOptions options_;
  MakeRole make_role_;
  asio::io_context loop_{1};
  NodeClock clock_;
  RealtimeRights rights_;
  std::unique_ptr<dds::Bus> bus_;
  dds::Circle members_, commanders_;  // of the present run: its nodes, and its harness
  std::unique_ptr<dds::Publisher<dds::Heartbeat>> heartbeats_;
  std::unique_ptr<dds::Publisher<dds::RunState>> states_;
  std::unique_ptr<dds::Publisher<dds::RunAck>> acks_;
  std::unique_ptr<dds::Subscriber<dds::Heartbeat>> others_;
  std::unique_ptr<dds::Subscriber<dds::RunScenario>> scenarios_;
  std::unique_ptr<dds::Subscriber<dds::RunCommand>> commands_;
  std::unique_ptr<dds::Subscriber<dds::FaultCommand>> faults_;
  asio::steady_timer beat_timer_{loop_};
  dds::Heartbeat heartbeat_;
  bool warned_of_sender_ = false;

  // State of the present run.
  std::string run_id_;
  dds::Participant harness_;
  std::string released_run_id_;  // the last one: what of it still comes is old
  dds::RunScenario scenario_;
  std::optional<LoadedScenario> loaded_;
  dds::RunState state_;  // as it was told last
  std::unique_ptr<LogPublisher> log_;
  Lateness lateness_;
  std::unique_ptr<Role> role_;  // notes lateness to its end
  std::int64_t last_command_ = 0;
  std::int64_t last_fault_ = 0;
  // Set by the harness's commands: idle, prepared, armed, running (until the command to stop), finished.
  dds::Phase phase_ = dds::Phase::kIdle;
  int exit_code_ = 0;
  std::chrono::steady_clock::time_point harness_heard_;
};

Node::Node(const NodeOptions& options, const MakeRole& make_role) : options_(options), make_role_(make_role) {
  // The threads of DDS inherit the mask: signals of the firmware's guard and of the loop are this thread's.
  sigset_t all, old;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &old);
  bus_ = std::make_unique<dds::Bus>(options.bus);
  heartbeats_ = std::make_unique<dds::Publisher<dds::Heartbeat>>(*bus_);
  states_ = std::make_unique<dds::Publisher<dds::RunState>>(*bus_);
  acks_ = std::make_unique<dds::Publisher<dds::RunAck>>(*bus_);
  others_ = std::make_unique<dds::Subscriber<dds::Heartbeat>>(*bus_);
  scenarios_ = std::make_unique<dds::Subscriber<dds::RunScenario>>(*bus_, Posted(&Node::OnScenario));
  commands_ =
      std::make_unique<dds::Subscriber<dds::RunCommand>>(*bus_, commanders_, Posted(&Node::OnCommand));
  faults_ = std::make_unique<dds::Subscriber<dds::FaultCommand>>(*bus_, commanders_, Posted(&Node::OnFault));
  pthread_sigmask(SIG_SETMASK, &old, nullptr);
  if (options.harness) Introduce(bus_->participant());
  // After the threads of DDS: they need not be punctual. A user's command is no part of the harness.
  if (!options.client || !std::holds_alternative<Program>(*options.client)) rights_ = AcquireRealtimeRights();

  heartbeat_.node_id = options.name;
  heartbeat_.kind = options.kind;
  heartbeat_.host = HostName();
  heartbeat_.pid = getpid();
  heartbeat_.version = TILTPROOF_VERSION;
  heartbeat_.capabilities = {fmt::format("scheduling={}", rights_.fifo ? "fifo" : "other"),
                             fmt::format("memory={}", rights_.locked_memory ? "locked" : "unlocked")};
  if (options.client) heartbeat_.capabilities.push_back(fmt::format("client={}", KindOf(*options.client)));
  if (options.cable) heartbeat_.capabilities.emplace_back("cable=serial");
  for (std::size_t end = 0; end < options.end_devices.size(); ++end)
    if (!options.end_devices[end].empty())
      heartbeat_.capabilities.push_back(fmt::format("end{}=serial", end));
  if (!options.id.empty()) heartbeat_.capabilities.push_back(fmt::format("id={}", options.id));
}

int Node::Run() {
  asio::signal_set signals(loop_, SIGTERM, SIGINT, SIGHUP);
  signals.async_wait([this](const boost::system::error_code& error, int number) {
    if (error) return;
    // Said before it is seen.
    if (!run_id_.empty())
      Fail(options_.kind == dds::NodeKind::kClient ? EndReason::kFirmwareLost : EndReason::kNodeLost,
           fmt::format("the {} node was ended (signal {}, {})", options_.name, number, sigdescr_np(number)));
    loop_.stop();
  });
  Beat();
  loop_.run();
  // A node that leaves in the middle of a run takes its ports with it; the harness sees it go.
  role_.reset();
  return exit_code_;
}

// Another node that sends references, which must be off when this one is on (paper, section 2.2); empty when
// there is none.
std::string Node::OtherSender() {
  const auto sends = [](dds::NodeKind kind) {
    return kind == dds::NodeKind::kBaseStation || kind == dds::NodeKind::kJoystick;
  };
  if (options_.harness || !sends(options_.kind)) return {};
  others_->Take();
  for (const auto& node : others_->Nodes())
    if (node.alive && sends(node.last.kind) && node.participant != bus_->participant())
      // One of two that began at the same moment stays.
      if (heartbeat_.sequence == 0 || !node.last.run_id.empty() ||
          std::tie(node.last.node_id, node.participant) < std::make_tuple(options_.name, bus_->participant()))
        return fmt::format("{} ({} on {}, process {})", node.last.node_id, Name(node.last.kind),
                           node.last.host, node.last.pid);
  return {};
}

// Before it says that it is there, and for a while from then on: of two that began at the same moment each may have
// missed the other. Later it stays: whoever comes has to stand back.
bool Node::StandsBack() {
  std::string other = OtherSender();
  if (heartbeat_.sequence >= kYoungBeats) {
    if (!other.empty() && !std::exchange(warned_of_sender_, true))
      Print(stderr,
            "tiltproof node {}: warning: {} sends references, too, and only one node may; end one of them\n",
            options_.name, other);
    return false;
  }
  if (heartbeat_.sequence == 0 && !options_.harness) {
    const auto until = std::chrono::steady_clock::now() + kListenFirst;
    // Told to end meanwhile, it stays stopped.
    while (other.empty() && !loop_.stopped() && std::chrono::steady_clock::now() < until) {
      loop_.run_one_for(kHeartbeatPeriod);
      other = OtherSender();
    }
  }
  if (other.empty()) return false;
  Print(
      stderr,
      "tiltproof node {}: refused: {} sends references already, and only one node may; end that one first\n",
      options_.name, other);
  return true;
}

void Node::Beat() {
  if (!flying() && StandsBack()) {
    exit_code_ = 3;
    loop_.stop();
    return;
  }
  ++heartbeat_.sequence;
  heartbeat_.run_id = run_id_;
  heartbeats_->Write(heartbeat_);
  if (flying()) role_->Flush();
  if (log_) log_->Flush();
  if (!run_id_.empty()) WatchHarness();
  beat_timer_.expires_after(kHeartbeatPeriod);
  beat_timer_.async_wait([this](const boost::system::error_code& error) {
    if (!error) Beat();
  });
}

void Node::WatchHarness() {
  const auto now = std::chrono::steady_clock::now();
  others_->Take();
  for (const auto& node : others_->Nodes())
    if (node.alive && node.participant == harness_ && node.last.run_id == run_id_) harness_heard_ = now;
  if (now - harness_heard_ < kHarnessLostAfter) return;
  // The firmware goes first, since what is printed while it is there is its own; the log last, since publishers that
  // still have what the harness missed take a while to close.
  role_.reset();
  Print(stderr, "tiltproof node {}: the harness of run {} is gone; the run is given up\n", options_.name,
        run_id_);
  Release();
}

void Node::OnScenario() {
  for (auto& [sender, scenario] : scenarios_->TakeWithSenders()) {
    if (options_.harness && sender != *options_.harness) continue;
    if (scenario.run_id == run_id_ && sender == harness_) MeetMembers(scenario);
    // In a run already, it stays there until that is over or its harness gone: another one has to wait.
    if (!NamesUs(scenario) || !run_id_.empty() || scenario.run_id == released_run_id_) continue;
    ForgetReleasedRun();
    run_id_ = scenario.run_id;
    harness_ = sender;
    commanders_.Admit(harness_, {});
    MeetMembers(scenario);
    scenario_ = std::move(scenario);
    last_command_ = last_fault_ = 0;
    harness_heard_ = std::chrono::steady_clock::now();
    state_ = {};
    if (options_.kind == dds::NodeKind::kClient) state_.client_id = options_.id;
    Tell(dds::Phase::kIdle);
  }
  OnCommand();
}

bool Node::NamesUs(const dds::RunScenario& scenario) const {
  const std::string us = ToText(bus_->participant());
  for (std::size_t i = 0; i < std::min(scenario.nodes.size(), scenario.participants.size()); ++i)
    if (scenario.nodes[i] == options_.name && scenario.participants[i] == us) return true;
  return false;
}

// It may be told again: a node that was started again in flight is another participant.
void Node::MeetMembers(const dds::RunScenario& scenario) {
  for (std::size_t i = 0; i < std::min(scenario.nodes.size(), scenario.participants.size()); ++i)
    if (const auto participant = dds::ParticipantNamed(scenario.participants[i]))
      members_.Admit(*participant, scenario.nodes[i]);
}

// Retires the last run's messages. They stay for latecomers until the next run: an attached node serves many.
void Node::ForgetReleasedRun() {
  if (released_run_id_.empty()) return;
  dds::RunAck ack;
  dds::RunState state;
  ack.run_id = state.run_id = released_run_id_;
  ack.node_id = state.node_id = options_.name;
  acks_->Retire(ack);
  states_->Retire(state);
}

void Node::OnCommand() {
  for (const auto& command : commands_->Take()) {
    const bool mine = command.node_id.empty() || command.node_id == options_.name;
    if (mine && command.run_id == run_id_ && command.sequence > last_command_) Obey(command);
  }
}

void Node::Obey(const dds::RunCommand& command) {
  last_command_ = command.sequence;
  dds::RunAck ack;
  ack.run_id = run_id_;
  ack.node_id = options_.name;
  ack.sequence = command.sequence;
  try {
    Do(command, ack);
    ack.ok = true;
  } catch (const std::exception& error) {
    ack.text = std::string(error.what()).substr(0, dds::kTextBytesMax);
  }
  acks_->Write(ack);
  if (ack.ok && command.verb != dds::Verb::kRelease) Tell(phase_);
  if (command.verb == dds::Verb::kRelease) Release();
}

void Node::Do(const dds::RunCommand& command, dds::RunAck& ack) {
  // Each verb needs what the one before has made.
  const auto need = [&](bool there) {
    if (!there) throw std::runtime_error(fmt::format("it is {}", Name(phase_)));
  };
  switch (command.verb) {
    case dds::Verb::kPrepare: {
      need(phase_ == dds::Phase::kIdle);
      loaded_ = options_.load(scenario_.scenario_yaml);
      if (const std::string why = DifferingFile(loaded_->scenario, scenario_.files, scenario_.file_hashes);
          !why.empty())
        throw std::runtime_error(why);
      log_ = std::make_unique<LogPublisher>(*bus_, run_id_, options_.name, harness_);
      lateness_ = {};
      lateness_.late_after_ns = loaded_->scenario.late_after_ns();
      role_ = make_role_(*this, options_);
      ack.ports = role_->Prepare(*loaded_, KindsNamed(command.client_kind));
      phase_ = dds::Phase::kPrepared;
      return;
    }
    case dds::Verb::kArm:
      need(phase_ == dds::Phase::kPrepared);
      role_->Arm(command.ports);
      phase_ = dds::Phase::kArmed;
      return;
    case dds::Verb::kStart:
      need(phase_ == dds::Phase::kArmed);
      phase_ = dds::Phase::kRunning;
      role_->Start();
      return;
    case dds::Verb::kStop: {
      need(phase_ != dds::Phase::kIdle && phase_ != dds::Phase::kFinished);
      phase_ = dds::Phase::kFinished;
      lateness_.stopped = clock_.Now();
      role_->Stop();
      lateness_.WriteTo(*log_, OwnProcessors());
      log_->Close();
      return;
    }
    case dds::Verb::kInject:
      need(phase_ == dds::Phase::kRunning);
      for (const dds::InjectedFault& fault : command.faults)
        if (const auto begin_ns = Inject({fault.text, fault.id, fault.start_ns}))
          ack.begins_ns.push_back(*begin_ns);
      return;
    case dds::Verb::kRelease:
      return;
  }
}

// Returns from when on the fault acts; nullopt where it does not act.
std::optional<TimeNs> Node::Inject(AddedFault fault) {
  // The harness has checked it already, also against the vehicle.
  ReadOptions options;
  options.models_folder = loaded_->scenario.model_file.parent_path();
  Scenario& flown = loaded_->scenario;
  AddFault(flown, fault, options);
  const auto done_until_ns = role_->DoneUntil(*faults::FindFaultType(flown.faults.back().type));
  if (done_until_ns) {
    flown.faults.pop_back();
    fault.start_ns = KeptBegin(flown, fault.start_ns, *done_until_ns);
    if (fault.start_ns >= flown.duration_ns) return fault.start_ns;
    AddFault(flown, fault, options);
  }
  role_->Inject(flown.faults.back());
  return done_until_ns ? std::optional(fault.start_ns) : std::nullopt;
}

void Node::Release() {
  phase_ = dds::Phase::kIdle;
  Tell(phase_);
  members_.Clear();
  commanders_.Clear();
  role_.reset();
  log_.reset();
  loaded_.reset();
  clock_ = {};
  released_run_id_ = std::exchange(run_id_, {});
  if (options_.harness) loop_.stop();
}

void Node::OnFault() {
  for (const auto& fault : faults_->Take()) {
    if (fault.run_id != run_id_ || fault.node_id != options_.name || fault.sequence <= last_fault_) continue;
    last_fault_ = fault.sequence;
    const auto order = FromMessage(fault);
    if (!order) continue;
    std::visit(Overloaded{[&](const LeaveBus& leave) { bus_->Partition(true, true, leave.duration_ns); },
                          [&](const SetClockRate& rate) { clock_.SetRate(rate.ppm); },
                          [&](const JumpClock& jump) { clock_.Jump(jump.by_ns); }},
               *order);
  }
}

void Node::SetPhase(dds::Phase phase, TimeNs time_ns, Origin origin, EndReason reason,
                    const std::string& text) {
  state_.time_ns = time_ns;
  state_.origin_ns = origin.known() ? origin.boot_time().ns() : 0;
  state_.end_reason = Name(reason);
  state_.text = text.substr(0, dds::kTextBytesMax);
  Tell(phase);
}

void Node::FailClient(const std::string& client_id, EndReason reason, const std::string& text) {
  state_.client_id = client_id;
  Fail(reason, text);
}

void Node::TellRole(std::uint32_t role) {
  if (options_.id.empty() || state_.role == role) return;
  state_.role = role;
  Tell(phase_);
}

// The role's failure stays the node's state until the node is released. A failed node does not run after the command to
// start, nor is it finished after the command to stop. The harness may see only the latest state.
void Node::Tell(dds::Phase phase) {
  state_.run_id = run_id_;
  state_.node_id = options_.name;
  if (state_.phase != dds::Phase::kFailed || phase == dds::Phase::kIdle) state_.phase = phase;
  states_->Write(state_);
}

}  // namespace

std::string FindPort(const Ports& ports, std::string_view name) {
  for (const auto& port : ports)
    if (port.name == name) return port.path;
  return {};
}

std::function<void()> InLoop(asio::io_context& loop, const std::shared_ptr<char>& alive,
                             std::function<void()> look) {
  return [&loop, weak = std::weak_ptr(alive), look = std::move(look)] {
    asio::post(loop, [weak, look] {
      if (!weak.expired()) look();
    });
  };
}

PeriodicTimer::PeriodicTimer(NodeServices& services, BootTime first, TimeNs period,
                             std::function<void(BootTime)> due)
    : services_(services),
      next_ns_(first),
      period_ns_(period),
      due_(std::move(due)),
      timer_(services.loop()) {
  Arm();
}

void PeriodicTimer::Arm() {
  timer_.expires_at(services_.clock().ToSteady(next_ns_));
  timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
    if (error || alive.expired()) return;
    const BootTime now = services_.clock().Now();
    services_.lateness().Note(next_ns_, now);
    do {
      next_ns_ += period_ns_;
    } while (next_ns_ <= now);
    // It may destroy this timer.
    const auto due = due_;
    Arm();
    due(now);
  });
}

int RunNode(const NodeOptions& options, const MakeRole& make_role) { return Node(options, make_role).Run(); }

}  // namespace tiltproof::harness
