#include "harness/run/flight.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "faults/random.h"
#include "faults/registry.h"
#include "harness/client/firmware_guard.h"
#include "harness/reference/trajectory.h"
#include "harness/run/client_channel.h"
#include "harness/run/log_builder.h"
#include "harness/run/reference_frame.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

// A flight draws its own numbers, whatever flight the thread has flown before.
class OwnDraws {
 public:
  OwnDraws() { faults::Random::Redraw(0); }
  ~OwnDraws() { faults::Random::Redraw(0); }
  OwnDraws(const OwnDraws&) = delete;
  OwnDraws& operator=(const OwnDraws&) = delete;
};

// The parts in this process, which a steered flight or a future changes.
struct LocalParts {
  LocalPlantServer& server;
  std::deque<LocalLine>& lines;
};

faults::ScheduleUse UseOf(const FlightOptions& options) {
  return {.grows = static_cast<bool>(options.steer),
          .keeps_activations = options.keeps_activations,
          .open = options.open};
}

// A window cannot say so.
void NeverBegins(faults::FaultSpec& fault) {
  fault.start_ns = kPowerOn;
  fault.end_ns = kNever;
  fault.period_ns = kNever;
  fault.duty.reset();
  fault.after.reset();
  fault.when = "false";
  fault.edge = faults::Edge::kLevel;
}

// Counts in boot time.
class Conductor final : private SteeredFlight {
 public:
  // `parts`: null where they are in other processes; then the flight is not steered and has no open fault.
  Conductor(const Scenario& scenario, std::span<Line* const> lines, PlantServer& server, LogBuilder& log,
            const FlightOptions& options, const LocalParts* parts);
  RunLog Run();

 private:
  TimeNs time_ns() const override { return started() ? origin().SimulationTime(steered_at_ns_) : 0; }
  const std::vector<double>& Row() override;
  TimeNs FaultTime(const faults::FaultSpec& fault) const override;
  void Add(const faults::FaultSpec& fault) override;
  void Remove(std::size_t fault) override;
  void Stop() override;
  void Steer(BootTime now) {
    if (steered_ == nullptr || stopped_) return;
    steered_at_ns_ = now;
    options_.steer(*this);
  }
  // Each client that is not lost, the selected one first.
  template <class Act>
  void Each(const Act& act) {
    for (ClientChannel* channel : in_turn_) With(*channel, act);
  }
  // A failure of one of several clients names it. The flight goes on without it, if another one can fly the vehicle.
  template <class Act>
  void With(ClientChannel& channel, const Act& act) {
    if (channel.is_lost()) return;
    try {
      act(channel);
    } catch (const FirmwareTrouble& trouble) {
      if (!scenario_.has_several_clients()) throw;
      channel.Lose(trouble);
      const bool is_last = std::ranges::all_of(channels_, &ClientChannel::is_lost);
      const bool is_the_one = !scenario_.is_redundant() && channel.index() == scenario_.selected_client();
      if (!is_last && !is_the_one) return;
      throw FirmwareTrouble(trouble.hung,
                            "client " + scenario_.client_id(channel.index()) + ": " + trouble.what() +
                                (is_last ? "; no client is left" : ""),
                            trouble.end);
    }
  }
  void Conduct();
  void MeetMoments(BootTime now);
  void Become(const Future& future);
  void EndBy(const FirmwareTrouble& trouble) {
    End(trouble.hung ? EndReason::kFirmwareHung : EndReason::kFirmwareCrashed, trouble.what());
    end_.firmware_end = trouble.end;
  }
  void End(EndReason reason, std::string text) {
    end_.reason = reason;
    end_.text = std::move(text);
  }
  bool EndsBefore(BootTime now);
  void AdvancePlant(BootTime to) { server_.Advance(to, Counts()); }
  void FollowAhead(const ClientChannel& channel, BootTime to);
  void ServePlantEnd(ClientChannel& channel, BootTime now);
  BootTime Horizon(const ClientChannel& channel, BootTime now) const;
  BootTime HorizonBeforeStart(const ClientChannel& channel) const;
  void AskRole(ClientChannel& channel);
  void TellRoles();
  void ForwardEvents();
  void SendReference(BootTime now);
  void SendOwn(BootTime now);
  RunLog Finish();
  const AllCounts& Counts();
  void Sample(BootTime now);

  bool started() const { return server_.state().started(); }
  bool over() const { return server_.state().over; }
  Origin origin() const { return server_.state().origin; }
  // When the flight ends, as far as it is known.
  BootTime EndTime() const {
    return started() ? origin().ToBootTime(end_ns_) : BootTime(scenario_.start_wait_ns());
  }

  const Scenario& scenario_;
  const FlightOptions& options_;
  PlantServer& server_;
  Trajectory trajectory_;
  ReferenceFramer references_;
  std::deque<BoardLine> board_lines_;    // in the scenario's order
  std::deque<ClientChannel> channels_;   // likewise
  std::vector<ClientChannel*> in_turn_;  // the selected client's first
  AllCounts counts_;
  LogBuilder& log_;
  record::End end_;
  TimeNs shortest_byte_ns_ = kNever;                // of the lines between boards
  const bool faults_wait_;                          // for each other, or for conditions
  std::vector<std::vector<std::uint8_t>> replies_;  // of the plant server, before they are sent
  std::vector<std::pair<std::size_t, std::vector<std::uint8_t>>> own_messages_;  // and their clients
  BootTime next_reference_ns_ = BootTime::Never();
  std::optional<TimeNs> sampled_ns_;  // the last time
  struct Role {
    std::optional<std::uint32_t> sampled, told;
  };
  std::vector<Role> roles_;  // of each client
  std::size_t moment_ = 0;   // of FlightOptions::moments, the next
  bool departed_ = false;    // the future of the options has begun
  const LocalParts* parts_;
  const LocalParts* steered_;  // null: it is not steered
  TimeNs end_ns_;              // of the flight
  bool stopped_ = false;
  BootTime steered_at_ns_;
  // For the steersman: a row, and the watched variables of all clients.
  std::vector<double> row_, watched_;
};

Conductor::Conductor(const Scenario& scenario, std::span<Line* const> lines, PlantServer& server,
                     LogBuilder& log, const FlightOptions& options, const LocalParts* parts)
    : scenario_(scenario),
      options_(options),
      server_(server),
      trajectory_(scenario.reference),
      references_(*scenario.link.protocol),
      counts_(lines.size()),
      log_(log),
      faults_wait_(std::any_of(scenario.faults.begin(), scenario.faults.end(), faults::WaitsForEvent)),
      parts_(parts),
      steered_(options.steer ? parts : nullptr),
      end_ns_(scenario.end_ns()) {
  for (std::size_t line = 0; line < scenario.lines.size(); ++line)
    board_lines_.emplace_back(scenario, line, log, true, UseOf(options));
  const auto ports_of = [&](std::size_t client) {
    std::vector<LinePort> ports;
    for (const LineEndId& id : scenario.line_ends_of(client))
      ports.push_back({&board_lines_.at(id.line), id.end});
    return ports;
  };
  for (std::size_t client = 0; client < lines.size(); ++client)
    in_turn_.push_back(&channels_.emplace_back(
        scenario, client, *lines[client], log,
        ClientChannel::Callbacks{
            .on_news = [this] { ForwardEvents(); },
            .before_ahead = [this](const ClientChannel& channel, BootTime at) { FollowAhead(channel, at); }},
        ports_of(client), UseOf(options)));
  for (const BoardLine& line : board_lines_) shortest_byte_ns_ = std::min(shortest_byte_ns_, line.ByteTime());
  std::swap(in_turn_.front(), in_turn_[scenario.selected_client()]);
  roles_.resize(lines.size());
  watched_.resize(lines.size() * scenario.watch.size(), std::numeric_limits<double>::quiet_NaN());
}

RunLog Conductor::Run() {
  const auto began = std::chrono::steady_clock::now();
  const OwnDraws draws;
  try {
    if (options_.future)
      for (ClientChannel& channel : channels_) channel.CutCommands(*options_.future);
    MeetMoments(BootTime::Earliest());
    Steer(BootTime::Earliest());
    Each([&](ClientChannel& channel) { channel.PowerOn(options_.make_client); });
    Conduct();
  } catch (const FirmwareTrouble& trouble) {
    EndBy(trouble);
  } catch (const faults::OpenFaultActs&) {
    throw;
  } catch (const std::exception& error) {
    if (!in_turn_.back()->exists() && !in_turn_.back()->is_lost()) throw;
    End(EndReason::kHarnessError, error.what());
  }
  end_.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  RunLog log = Finish();
  if (options_.retire)
    for (ClientChannel& channel : channels_) options_.retire(channel.TakeClient());
  return log;
}

void Conductor::Conduct() {
  for (BootTime now = BootTime::Earliest();;) {
    BootTime next = std::min(next_reference_ns_, server_.state().next_send_ns);
    for (const ClientChannel& channel : channels_) next = std::min(next, channel.Next());
    now = std::max(now, next);
    MeetMoments(now);
    if (EndsBefore(now)) return;

    if (now == next_reference_ns_) Sample(now);
    // First of all, so that rows of the past show nothing of what happens now.
    AdvancePlant(now);
    if (over()) return;
    ForwardEvents();
    TellRoles();
    if (now == next_reference_ns_) {
      Steer(now);
      SendReference(now);
    }
    SendOwn(now);
    const bool was_started = started();
    for (ClientChannel* channel : in_turn_) ServePlantEnd(*channel, now);
    if (started() && !was_started) {
      Sample(now);
      TellRoles();
      Each([&](ClientChannel& channel) { channel.Command(origin()); });
    }
    for (ClientChannel* channel : in_turn_) {
      if (channel->is_lost()) channel->Run(now, now);
      With(*channel, [&](ClientChannel& own) { own.Run(now, Horizon(own, now)); });
    }
  }
}

// Before the events at `now`.
void Conductor::MeetMoments(BootTime now) {
  const TimeNs time_ns = started() ? origin().SimulationTime(now) : kPowerOn;
  while (moment_ < options_.moments.size() && started() && options_.moments[moment_] <= time_ns)
    if (const auto future = options_.at_moment(moment_++)) {
      moment_ = options_.moments.size();
      Become(*future);
    }
  if (departed_ || !options_.future || options_.future->from_ns > time_ns) return;
  departed_ = true;
  Become(*options_.future);
}

const std::vector<double>& Conductor::Row() {
  steered_->server.Look(Counts(), row_);
  std::copy(watched_.begin(), watched_.end(), row_.end() - static_cast<std::ptrdiff_t>(watched_.size()));
  return row_;
}

// A chunk that has passed the filters is past, even if it is still on the line: its sender knows when it has left, by the clock that
// it had. A client that runs on has got the bytes of this very instant.
TimeNs Conductor::FaultTime(const faults::FaultSpec& fault) const {
  if (!started()) return 0;
  const faults::FaultType* type = faults::FindFaultType(fault.type);
  Check(type != nullptr, "a fault that is added is valid");
  if (type->As<faults::ReceiverKind>() != nullptr) return time_ns() + 1;
  TimeNs time_ns = this->time_ns();
  if (!type->IsOneOf<faults::WireKind, faults::ClockKind>()) return time_ns;
  for (std::size_t line = 0; line < board_lines_.size(); ++line)
    if (fault.line == scenario_.lines[line].id)
      return std::max(time_ns, origin().SimulationTime(board_lines_[line].FreeTime()));
  for (std::size_t client = 0; client < channels_.size(); ++client)
    if (fault.client.empty() || fault.client == scenario_.client_id(client))
      time_ns = std::max(time_ns, origin().SimulationTime(steered_->lines[client].FreeTime()));
  return time_ns;
}

void Conductor::Add(const faults::FaultSpec& fault) {
  Check(!faults::WaitsForEvent(fault) && fault.start_ns >= FaultTime(fault),
        "a fault that is added begins from now on, by the clock");
  steered_->server.Add(fault);
  for (LocalLine& line : steered_->lines) line.Add(fault);
  for (BoardLine& line : board_lines_) line.Add(fault);
  const std::size_t place = options_.flown->faults.size();
  for (ClientChannel& channel : channels_) {
    if (channel.is_lost())
      channel.Add(fault, place);
    else
      With(channel, [&](ClientChannel& own) { own.Add(fault, place); });
  }
  options_.flown->faults.push_back(fault);
}

void Conductor::Remove(std::size_t fault) {
  CheckIndex(fault, options_.flown->faults.size(), "a fault that is removed is one of the scenario");
  faults::FaultSpec& spec = options_.flown->faults[fault];
  const TimeNs end_ns = started() ? FaultTime(spec) : kPowerOn;
  const std::vector<faults::FaultEvent> cut = {{faults::FaultEvent::Kind::kCut, fault, end_ns}};
  server_.Hear(cut);
  for (ClientChannel& channel : channels_) channel.Hear(cut);
  for (BoardLine& line : board_lines_) line.Hear(cut);
  if (!started() || spec.start_ns >= end_ns)
    NeverBegins(spec);
  else
    spec.end_ns = std::min(spec.end_ns, end_ns);
}

void Conductor::Stop() {
  stopped_ = true;
  end_ns_ = std::min(std::max(time_ns(), scenario_.link.protocol->control_period_ns), end_ns_);
  options_.flown->stop_ns = end_ns_;
}

void Conductor::Become(const Future& future) {
  std::vector<faults::FaultEvent> cuts;
  for (const std::size_t fault : future.cut)
    cuts.push_back({faults::FaultEvent::Kind::kCut, fault, future.from_ns});
  server_.Hear(cuts);
  for (ClientChannel& channel : channels_) channel.Hear(cuts);
  for (BoardLine& line : board_lines_) line.Hear(cuts);
  faults::Random::Redraw(future.draw);
  if (!future.given) return;
  Check(parts_ != nullptr && board_lines_.empty(), "a fault is given to a flight in one process");
  parts_->server.Give(*future.given);
  for (LocalLine& line : parts_->lines) line.Give(*future.given);
  for (ClientChannel& channel : channels_) channel.Give(*future.given);
}

// True if the flight ends before the events at `now`.
bool Conductor::EndsBefore(BootTime now) {
  if (now > EndTime()) {
    if (started()) {
      Sample(EndTime());
      AdvancePlant(EndTime());
      // The last row is at duration_s, on the grid or not.
      if (!over()) server_.Finish(EndTime(), Counts());
    } else {
      End(EndReason::kNeverStarted, NeverStartedText(scenario_));
    }
    return true;
  }
  Each([&](ClientChannel& channel) { channel.BeginTurn(now); });
  if (options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed)) {
    End(EndReason::kInterrupted, "interrupted");
    return true;
  }
  for (ClientChannel& channel : channels_) {
    const auto& overfull = channel.line().overfull();
    if (!overfull || (channel.is_lost() && !overfull->by_faults)) continue;
    End(EndReason::kLineOverfull, overfull->text);
    return true;
  }
  for (const BoardLine& line : board_lines_)
    for (std::size_t end = 0; end < 2; ++end)
      if (const auto& overfull = line.overfull(end); overfull && overfull->by_faults) {
        End(EndReason::kLineOverfull, overfull->text);
        return true;
      }
  return false;
}

// The plant follows a client that runs ahead of it, but not past what must be served first.
void Conductor::FollowAhead(const ClientChannel& channel, BootTime to) {
  if (!started() || over()) return;
  to = std::min({to, channel.line().NextArrival(Direction::kToPlant), server_.state().next_send_ns});
  for (const ClientChannel& other : channels_)
    if (&other != &channel) to = std::min(to, other.Next());
  AdvancePlant(to);
  ForwardEvents();
}

void Conductor::ServePlantEnd(ClientChannel& channel, BootTime now) {
  Line& line = channel.line();
  if (line.NextArrival(Direction::kToPlant) > now) return;
  while (const auto piece = line.TakePiece(Direction::kToPlant, now)) {
    Check(piece->arrival_ns <= now, "the plant hears nothing before it arrives");
    if (piece->message == nullptr) continue;
    const bool was_started = started();
    const BootTime arrival = piece->arrival_ns;
    if (started() && scenario_.arbiter.type == ArbiterType::kActiveClaims) AskRole(channel);
    replies_.clear();
    server_.Receive(channel.index(), arrival, *piece->message, [this](std::span<const std::uint8_t> frame) {
      replies_.emplace_back(frame.begin(), frame.end());
    });
    ForwardEvents();  // before the replies go
    for (const auto& reply : replies_) line.Transmit(Direction::kToClient, arrival, reply);
    ForwardEvents();
    if (was_started || !started()) continue;
    for (ClientChannel& other : channels_) other.line().SetOrigin(origin());
    for (BoardLine& between : board_lines_) between.SetOrigin(origin());
    SendReference(arrival);
    SendOwn(arrival);
  }
}

// Sends what the server sends by itself.
void Conductor::SendOwn(BootTime now) {
  if (now < server_.state().next_send_ns) return;
  own_messages_.clear();
  server_.SendOwn(now, [this](std::size_t client, std::span<const std::uint8_t> frame) {
    own_messages_.emplace_back(client, std::vector<std::uint8_t>(frame.begin(), frame.end()));
  });
  ForwardEvents();  // before the messages go
  for (const auto& [client, frame] : own_messages_)
    channels_[client].line().Transmit(Direction::kToClient, now, frame);
  ForwardEvents();
}

// Nothing that is not on its way yet can reach the client before this time. A client with its own processor
// comes back at least every period.
BootTime Conductor::Horizon(const ClientChannel& channel, BootTime now) const {
  BootTime horizon = std::min(
      {next_reference_ns_, server_.state().next_send_ns, channel.line().NextArrival(Direction::kToPlant),
       now + scenario_.link.protocol->control_period_ns, std::max(EndTime(), now) + 1});
  if (!started()) horizon = std::min(horizon, std::max(HorizonBeforeStart(channel), now));
  // A byte on a line between boards arrives one byte time after its client has acted, or later.
  if (channel.has_ports())
    for (const ClientChannel& other : channels_)
      if (&other != &channel && !other.is_lost() && other.Next() != BootTime::Never())
        horizon = std::min(horizon, std::max(other.Next(), now) + shortest_byte_ns_);
  Check(now <= horizon, "nothing that the client must know lies in its past");
  return horizon;
}

// References begin with a `start` that makes t = 0: before it, no client runs ahead of another one that may send it. Of
// clients that are equally far, the last in turn goes first, by less than a `start` is on its way.
BootTime Conductor::HorizonBeforeStart(const ClientChannel& channel) const {
  const TimeNs ahead_ns = std::max<TimeNs>(scenario_.link.main_rate().BytesTime(1), 1);
  BootTime horizon = BootTime::Never();
  bool is_earlier_in_turn = true;
  for (const ClientChannel* other : in_turn_) {
    const bool may_start = scenario_.is_redundant() || other == in_turn_.front();
    if (other == &channel) {
      if (may_start && !scenario_.is_redundant()) return horizon;
      is_earlier_in_turn = false;
    } else if (may_start && !other->is_lost() && other->Next() != BootTime::Never()) {
      const bool goes_after = scenario_.is_redundant() && is_earlier_in_turn;
      horizon = std::min(horizon, goes_after ? other->Next() + ahead_ns : other->Next());
    }
  }
  return horizon;
}

// Faults that wait for a condition or for another fault hear of it before anything else passes.
void Conductor::ForwardEvents() {
  if (!faults_wait_) return;
  const std::vector<faults::FaultEvent> of_plant = server_.PollEvents();
  std::vector<std::pair<ClientChannel*, std::vector<faults::FaultEvent>>> of_channels;
  for (ClientChannel& channel : channels_) of_channels.emplace_back(&channel, channel.PollEvents());
  std::vector<std::pair<BoardLine*, std::vector<faults::FaultEvent>>> of_lines;
  for (BoardLine& line : board_lines_) of_lines.emplace_back(&line, line.PollEvents());
  const auto tell = [&](const std::vector<faults::FaultEvent>& events, const void* origin, bool plant) {
    if (plant) server_.Hear(events);
    for (ClientChannel& other : channels_)
      if (&other != origin) other.Hear(events);
    for (BoardLine& other : board_lines_)
      if (&other != origin) other.Hear(events);
  };
  for (const auto& [channel, events] : of_channels) tell(events, channel, true);
  for (const auto& [line, events] : of_lines) tell(events, line, true);
  tell(of_plant, nullptr, false);
}

const AllCounts& Conductor::Counts() {
  for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] = channels_[i].line().counts();
  return counts_;
}

// The base station follows the simulation's clock (paper, section 2.2, Figure 6).
void Conductor::SendReference(BootTime now) {
  Check(started(), "references begin with the flight");
  const std::vector<std::uint8_t> frame =
      references_.Frame(trajectory_.At(origin().SimulationTime(now)), now);
  if (!frame.empty())
    for (ClientChannel& channel : channels_) channel.line().Transmit(Direction::kReference, now, frame);
  ForwardEvents();
  next_reference_ns_ = now + scenario_.link.protocol->control_period_ns;
  if (options_.progress_ns != nullptr)
    options_.progress_ns->store(origin().SimulationTime(now), std::memory_order_relaxed);
}

// Every client has come as far as `now`, which is on the grid of the trace's rows.
void Conductor::Sample(BootTime now) {
  const TimeNs time_ns = origin().SimulationTime(now);
  if (sampled_ns_ && *sampled_ns_ >= time_ns) return;
  sampled_ns_ = time_ns;
  // In the order of the scenario's clients; turns may have another order.
  for (ClientChannel& channel : channels_) {
    if (channel.is_lost()) continue;
    ClientSample sample;
    With(channel, [&](ClientChannel& own) { sample = own.Sample(); });
    if (scenario_.has_several_clients() && sample.role) {
      log_.Write({time_ns, channel.index(), record::Role{*sample.role}});
      roles_.at(channel.index()).sampled = sample.role;
    } else if (scenario_.arbiter.type == ArbiterType::kActiveClaims && !channel.is_lost()) {
      throw std::runtime_error("client " + scenario_.client_id(channel.index()) +
                               " tells no role, and the arbiter active_claims needs it");
    }
    if (sample.supervisor_state)
      log_.Write({time_ns, channel.index(), record::State{*sample.supervisor_state}});
    if (scenario_.watch.empty()) continue;
    sample.watched.resize(scenario_.watch.size(), std::numeric_limits<double>::quiet_NaN());
    if (steered_ != nullptr)
      std::ranges::copy(sample.watched, watched_.begin() + static_cast<std::ptrdiff_t>(
                                                               channel.index() * scenario_.watch.size()));
    log_.Write({time_ns, channel.index(), record::Watched{std::move(sample.watched)}});
  }
}

// A command counts by the role in which it comes, not by that of the row before: the first one would be lost.
void Conductor::AskRole(ClientChannel& channel) {
  if (channel.is_lost()) return;
  ClientSample sample;
  With(channel, [&](ClientChannel& own) { sample = own.Sample(); });
  if (sample.role) roles_.at(channel.index()).sampled = sample.role;
  TellRoles();
}

// Roles that have changed, once the plant has come as far as the clients: they hold from the next boundary on.
void Conductor::TellRoles() {
  for (std::size_t client = 0; client < roles_.size(); ++client) {
    if (roles_[client].sampled == roles_[client].told) continue;
    roles_[client].told = roles_[client].sampled;
    server_.NoteRole(client, *roles_[client].told);
  }
}

RunLog Conductor::Finish() {
  const PlantServer::State& state = server_.state();
  if (state.over && end_.reason == EndReason::kCompleted) End(state.end_reason, state.end_text);
  TimeNs end_ns = 0;
  if (state.started()) end_ns = end_.reason == EndReason::kCompleted ? end_ns_ : state.reached_ns;
  // After a failure a client may be in the middle of a call.
  const bool trouble = end_.reason == EndReason::kFirmwareHung ||
                       end_.reason == EndReason::kFirmwareCrashed || end_.reason == EndReason::kHarnessError;
  if (!trouble) {
    try {
      Each([&](ClientChannel& channel) { channel.AskStatus(); });
    } catch (const FirmwareTrouble& late) {
      EndBy(late);
    }
  }
  for (ClientChannel& channel : channels_) channel.Finish(state.origin);
  // A part in another process may be gone, and its records with it; the others' are kept.
  const auto keep_going = [&](const auto& write) {
    try {
      write();
    } catch (const std::exception& error) {
      if (end_.reason != EndReason::kHarnessError) End(EndReason::kHarnessError, error.what());
    }
  };
  keep_going([&] { server_.WriteTotals(); });
  const BootTime end = state.origin.OrPowerOn().ToBootTime(end_ns);
  for (ClientChannel& channel : channels_) keep_going([&] { channel.line().Finish(end); });
  for (BoardLine& line : board_lines_) line.Finish(end);
  log_.Write({end_ns, {}, std::move(end_)});
  return log_.Take();
}

}  // namespace

namespace {

bool IsOnWire(const faults::FaultSpec& fault) {
  const faults::FaultType* type = faults::FindFaultType(fault.type);
  return fault.line.empty() && (type == nullptr || type->IsOneOf<faults::WireKind>());
}

}  // namespace

ClientSettings SettingsOf(const Scenario& scenario, std::size_t client) {
  std::vector<EmulatorLines::Between> between;
  for (const LineEndId& id : scenario.line_ends_of(client))
    between.push_back({scenario.lines[id.line].id, scenario.lines[id.line].rate()});
  return {.firmware = scenario.firmware_of(client),
          .protocol = scenario.link.protocol,
          .lines = {.main = scenario.link.main_rate(),
                    .reference = scenario.link.reference_rate(),
                    .between = between,
                    .faulty = std::any_of(scenario.faults.begin(), scenario.faults.end(), IsOnWire)},
          .start_within_ns = scenario.start_within_ns,
          .watch = scenario.watch,
          .place = client};
}

std::string NeverStartedText(const Scenario& scenario) {
  const auto& messages = scenario.link.protocol->messages;
  const auto start = std::find_if(messages.begin(), messages.end(),
                                  [](const link::MessageType& type) { return type.starts; });
  return "the server accepted no `" + (start == messages.end() ? "start" : start->name) +
         "` message within " + std::to_string(ToSeconds(scenario.start_wait_ns())) + " s of power-on";
}

RunLog Conduct(const Scenario& scenario, std::span<Line* const> lines, PlantServer& server, LogBuilder& log,
               const FlightOptions& options) {
  return Conductor(scenario, lines, server, log, options, nullptr).Run();
}

RunLog Fly(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options) {
  const VehicleSignals signals = model.signals();
  const bool steers = static_cast<bool>(options.steer);
  Check(!steers || options.flown != nullptr, "a steered flight tells what was flown");
  LogBuilder log(steers ? *options.flown : scenario, signals, options.observer, options.parts);
  LocalLines lines(scenario, log, UseOf(options));
  LocalPlantServer server(scenario, model, log, UseOf(options));
  const LocalParts parts{server, lines.local()};
  return Conductor(scenario, lines.all(), server, log, options, &parts).Run();
}

}  // namespace tiltproof::harness
