#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "harness/client/client.h"
#include "harness/node/board_reset.h"
#include "harness/node/cpu_wait_watch.h"
#include "harness/node/deaf_receiver.h"
#include "harness/node/port_end.h"
#include "harness/node/pty_canary.h"
#include "harness/node/reset_listener.h"
#include "harness/node/roles.h"
#include "harness/run/line.h"
#include "harness/run/message_receiver.h"
#include "harness/run/realtime/client_parts.h"
#include "harness/run/realtime/send_backlog.h"
#include "harness/run/reference_frame.h"
#include "harness/run/reference_talk.h"
#include "link/pty.h"
#include "link/serial_devices.h"
#include "link/serial_port.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using link::kDirections;

constexpr std::size_t kRoundTripSampleCount = 50;

// Length of the shortest actuator message, in bytes.
std::size_t ShortestCommand(const link::Protocol& protocol) {
  std::size_t least = link::kPayloadBytesMax;
  for (const link::MessageType& type : protocol.messages)
    if (type.kind == link::MessageKind::kActuators) least = std::min(least, type.payload_bytes);
  return least;
}

class LinkRole final : public Role {
 public:
  LinkRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        client_id_(options.id),
        board_(options.client ? std::get<SerialBoard>(*options.client)
                              : options.cable.value_or(SerialBoard{})),
        has_board_(options.client.has_value()),
        timer_(services.loop()),
        boot_timer_(services.loop()),
        references_(services.bus(), services.members(),
                    InLoop(services.loop(), alive_, [this] { OnReferences(); })),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& clients) override {
    const std::optional<ClientSpec>& client = clients.at(0);
    client_is_library_ = client && std::holds_alternative<HostLibrary>(*client);
    client_is_emulator_ = client && std::holds_alternative<EmulatedImage>(*client);
    scenario_ = loaded.scenario;
    place_ = ClientPlace(scenario_, client_id_);
    NeedRole(scenario_, place_, !has_board_);
    client_takes_bytes_ = client_is_emulator_ || link::IsSocketName(board_.device);
    if (client_is_emulator_)
      for (const Direction direction : {Direction::kToClient, Direction::kReference})
        deaf_[static_cast<std::size_t>(direction)] = DeafReceiver(scenario_, place_);
    plant_ = std::make_unique<link::Pty>(services_.loop());
    base_station_ = std::make_unique<link::Pty>(services_.loop());
    Ports ports = {{PartName(scenario_, "plant", place_), plant_->slave_path()},
                   {PartName(scenario_, "base_station", place_), base_station_->slave_path()}};
    Open(client_, board_.device, scenario_.link.port_baud(), "client", ports);
    if (board_.device.empty() || !board_.reference_device.empty())
      Open(reference_, board_.reference_device, scenario_.link.reference_port_baud(), "client_reference",
           ports);
    // At a real port the hardware takes the bytes' time, and its adapter its own.
    const bool hardware = client_.TakesByteTime();
    if (hardware) {
      scenario_.link.adapter_latency_ms = 0;
      scenario_.link.adapter.reset();
    }
    line_.emplace(scenario_, round_trips_, place_, !hardware, faults::ScheduleUse{.grows = true});
    if (scenario_.link.protocol->streams()) backlog_.emplace(MakeBacklog());
    reference_talk_.emplace(*scenario_.link.protocol);
    framer_.emplace(*scenario_.link.protocol);
    actuators_bytes_ = ShortestCommand(*scenario_.link.protocol);
    opened_ns_ = Now();
    return ports;
  }

  void Arm(const Ports& /*ports*/) override {
    plant_->master().Start(
        [this](std::span<const std::uint8_t> bytes) {
          // The server answers at once: what it takes longer is this machine's doing.
          if (asked_plant_ns_ != BootTime::Never()) services_.lateness().Note(asked_plant_ns_, Now());
          asked_plant_ns_ = BootTime::Never();
          if (backlog_)
            if (const BootTime now = Now(); const auto sent_ns = backlog_->Take(now, bytes.size()))
              services_.lateness().NoteBacklog(now, *sent_ns);
          Transmit(Direction::kToClient, bytes);
        },
        Lost("plant's port"));
    canary_ = std::make_unique<PtyCanary>(services_);
    Read(base_station_->master(), Direction::kReference, "base station");
    armed_ = true;
    if (!board_.reset.empty()) reset_listener_.emplace(*scenario_.link.protocol);
    if (link::IsSocketName(board_.device)) return;
    // A program on a pseudo-terminal may play the board.
    if (const auto board = link::ProcessBehind(board_.device))
      board_watch_.emplace(services_, scenario_, *board);
    Listen();
  }

  // An emulator may begin as soon as its sockets are taken: then everybody has to be ready. So with a board that is reset.
  void Start() override {
    if (link::IsSocketName(board_.device)) ConnectSockets();
    if (board_.reset.empty()) return;
    reset_.emplace(
        services_, board_.reset, *client_.serial, [this] { ListenAfterReset(); },
        [this](const std::string& why) {
          services_.Note(0, "board_reset", why, Whose(scenario_, place_));
          services_.Fail(EndReason::kNodeLost, why);
        });
  }

  void Flush() override {
    if (!line_->origin().known()) return;
    services_.lateness().origin = line_->origin();
    line_->WriteActivations();
    SampleCounts(Now());
    JudgeRoundTrip();
  }

  // Bytes that were sent have had their faults, also where they still wait for the line.
  std::optional<TimeNs> DoneUntil(const faults::FaultType& type) override {
    if (!type.IsOneOf<faults::WireKind>()) return std::nullopt;
    return line_->origin().known() ? line_->origin().SimulationTime(std::max(Now(), sent_until_ns_)) : 0;
  }

  void Inject(const faults::FaultSpec& fault) override {
    scenario_.faults.push_back(fault);
    line_->Add(fault);
  }

  void Stop() override {
    armed_ = false;
    timer_.cancel();
    canary_.reset();
    board_watch_.reset();
    reset_.reset();
    boot_timer_.cancel();
    const BootTime now = Now();
    const Origin origin = line_->origin().known() ? line_->origin() : Origin(now);
    if (const std::string trouble = reference_talk_->Trouble(); !trouble.empty() && !line_->origin().known())
      services_.Note(0, kLineTroubleEvent, trouble, Whose(scenario_, place_));
    SampleCounts(now);
    // Without t = 0 all records count from now.
    if (!line_->origin().known()) line_->SetOrigin(origin);
    line_->Finish(std::min(now, origin.ToBootTime(scenario_.end_ns())));
  }

 private:
  SendBacklog MakeBacklog() const {
    const link::Protocol& protocol = *scenario_.link.protocol;
    const TimeNs period_ns = protocol.control_period_ns;
    std::int64_t bytes_count = 0;
    for (const link::MessageType& type : protocol.messages) {
      if (type.period_ns == 0) continue;
      const std::vector<std::uint8_t> payload(type.payload_bytes);
      const auto frame_bytes = static_cast<std::int64_t>(protocol.framing->Encode(payload).size());
      bytes_count += frame_bytes * ((period_ns + type.period_ns - 1) / type.period_ns);
    }
    const link::LineRate rate = scenario_.link.main_rate();
    return {rate, period_ns / 2 + rate.BytesTime(bytes_count)};
  }

  void Open(PortEnd& end, const std::string& device, std::int64_t baud, const char* port, Ports& ports) {
    end.Open(services_,
             {.device = device,
              .baud = baud,
              .character = scenario_.link.character,
              .for_emulator = client_is_emulator_,
              .name = PartName(scenario_, port, place_),
              .client = Whose(scenario_, place_)},
             ports);
  }

  void ConnectSockets() {
    opened_ns_ = Now();
    for (PortEnd* end : {&client_, &reference_}) end->ConnectSocket(services_.loop());
    if (const auto emulator = client_.serial->PeerProcess())
      board_watch_.emplace(services_, scenario_, *emulator);
    Listen();
  }

  void Listen() {
    // Bytes that have come already get their time now: a board did not send them all at once.
    if (client_.serial && client_.serial->UnreadBytes() > 0) services_.lateness().Note(opened_ns_, Now());
    Read(*client_.line, Direction::kToPlant, "client");
    // The client should send nothing there, but its leaving is detected there. A pseudo-terminal that is not
    // open has nothing to report.
    if (reference_.line != nullptr && !reference_.pty)
      reference_.line->Start(
          [this](std::span<const std::uint8_t> bytes) {
            if (armed_ && !line_->origin().known()) reference_talk_->Hear(bytes);
          },
          Lost("client's reference port"));
  }

  link::SerialPort::Closed Lost(std::string name) {
    return [this, name = std::move(name)](const std::string& reason) {
      const std::string text = fmt::format("the {} is gone: {}", name, reason);
      const Origin origin = line_->origin();
      services_.Note(origin.known() ? origin.SimulationTime(Now()) : 0, "port_lost", text,
                     Whose(scenario_, place_));
      services_.Fail(EndReason::kNodeLost, text);
    };
  }

  void Read(link::ByteLine& port, Direction direction, const char* name) {
    port.Start(
        [this, direction](std::span<const std::uint8_t> bytes) {
          if (direction != Direction::kToPlant || !reset_listener_ || reset_listener_->passes())
            Transmit(direction, bytes);
          else if (const auto passed = reset_listener_->Hear(bytes); !passed.empty())
            Transmit(direction, passed);
        },
        Lost(std::string(name) + "'s port"));
  }

  void ListenAfterReset() {
    reset_listener_->ResetEnded();
    boot_timer_.expires_after(std::chrono::nanoseconds(ResetListener::kSilenceMax));
    boot_timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
      if (error || alive.expired() || reset_listener_->passes()) return;
      if (const auto start = reset_listener_->GiveUp(); !start.empty()) Transmit(Direction::kToPlant, start);
    });
  }

  // Bytes do not arrive before they were sent, not even when a fault sets the clock.
  BootTime Now() { return now_ns_ = std::max(now_ns_, services_.clock().Now()); }

  void OnReferences() {
    for (const auto& reference : references_.Take()) {
      if (!armed_ || reference.run_id != services_.run_id()) continue;
      const auto point = FromRow(reference.values);
      if (!point) continue;
      if (const auto frame = framer_->Frame(*point, Now()); !frame.empty())
        Transmit(Direction::kReference, frame);
    }
  }

  void OnStates() {
    for (const auto& state : states_.Take())
      // Only the plant's state has it; perhaps only the last state has arrived.
      if (armed_ && scenario_.has_several_clients() && state.run_id == services_.run_id() &&
          state.origin_ns != 0 && !line_->origin().known())
        line_->SetOrigin(Origin(BootTime(state.origin_ns)));
  }

  void Transmit(Direction direction, std::span<const std::uint8_t> bytes) {
    if (!armed_) return;
    const BootTime now = Now();
    // A firmware library answers within microseconds: what it takes longer is this machine's doing.
    if (direction == Direction::kToPlant && client_is_library_ && bytes.size() >= actuators_bytes_ &&
        line_->unanswered_reply() != BootTime::Never())
      services_.lateness().Note(line_->unanswered_reply(), now);
    // The speed of an emulated processor is this machine's doing, too.
    if (direction == Direction::kToPlant && client_takes_bytes_ &&
        line_->unanswered_reply() != BootTime::Never())
      services_.lateness().Note(line_->unanswered_reply() + scenario_.late_after_ns(), now);
    sent_until_ns_ = std::max(sent_until_ns_, line_->Transmit(direction, now, bytes));
    Pump();
    const auto& overfull = line_->overfull();
    if (!overfull) return;
    armed_ = false;  // nothing passes any more
    const EndReason of_sender =
        direction == Direction::kReference ? EndReason::kNodeLost : EndReason::kFirmwareHung;
    services_.Fail(overfull->by_faults ? EndReason::kLineOverfull : of_sender, overfull->text);
  }

  // Hands over what has arrived, and comes back for the rest.
  void Pump() {
    const BootTime now = Now();
    SampleCounts(now);
    BootTime next = BootTime::Never();
    for (const Direction direction : kDirections) {
      link::ByteLine* port = direction == Direction::kToPlant    ? &plant_->master()
                             : direction == Direction::kToClient ? client_.line
                                                                 : reference_.line;
      while (const auto piece = line_->TakePiece(direction, now)) {
        // With several clients, the plant decides whose message is t = 0.
        if (piece->message != nullptr && !scenario_.has_several_clients() &&
            origin_.Note(piece->arrival_ns, *piece->message))
          line_->SetOrigin(origin_.origin());
        services_.lateness().Note(piece->arrival_ns, now);
        std::span<const std::uint8_t> bytes = piece->bytes;
        if (line_->origin().known())
          bytes = bytes.first(deaf_[static_cast<std::size_t>(direction)].Keeps(
              line_->origin().SimulationTime(piece->arrival_ns), bytes.size()));
        if (port != nullptr && !bytes.empty()) port->Write(bytes);
        if (piece->message != nullptr && !piece->message->type->reply.empty()) asked_plant_ns_ = now;
      }
      next = std::min(next, NextHandOver(line_->NextArrival(direction),
                                         direction != Direction::kToPlant && client_takes_bytes_, now));
    }
    timer_.cancel();
    if (next == BootTime::Never()) return;
    timer_.expires_at(services_.clock().ToSteady(next));
    timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
      if (!error && !alive.expired() && armed_) Pump();
    });
  }

  // The counters as they stood on the grid of control periods, for the trace.
  void SampleCounts(BootTime now) {
    if (!line_->origin().known()) return;
    for (; line_->origin().ToBootTime(next_sample_ns_) <= now && next_sample_ns_ <= scenario_.end_ns();
         next_sample_ns_ += scenario_.link.protocol->control_period_ns)
      services_.log().Write({next_sample_ns_, place_, record::Counters{line_->counts()}});
  }

  void JudgeRoundTrip() {
    std::vector<TimeNs>& round_trips = round_trips_.first;
    if (judged_ || round_trips.size() < kRoundTripSampleCount) return;
    judged_ = true;
    const auto middle = round_trips.begin() + kRoundTripSampleCount / 2;
    std::nth_element(round_trips.begin(), middle, round_trips.end());
    const TimeNs now = line_->origin().SimulationTime(Now());
    const double median_ms = ToSeconds(*middle) * 1e3;
    services_.Note(now, "client_round_trip",
                   fmt::format("a reply is answered after {:.2f} ms (median of the first {})", median_ms,
                               kRoundTripSampleCount),
                   Whose(scenario_, place_));
    // A client that eats half the delay margin at the median sits behind a buffering adapter, most likely.
    if (*middle <= scenario_.delay_margin_ns / 2 || board_.device.empty()) return;
    services_.Note(
        now, kSlowAdapterEvent,
        fmt::format("{:.1f} ms between reply and actuators: a USB-serial adapter that buffers, most likely. "
                    "It eats the loop's delay margin of {} ms; see `tiltproof doctor --client serial:{}`",
                    median_ms, ToSeconds(scenario_.delay_margin_ns) * 1e3, board_.device),
        Whose(scenario_, place_));
  }

  // The line's records on their way to the log, of which it keeps the first round trips.
  struct RoundTrips final : RecordSink {
    explicit RoundTrips(NodeServices& services_in) : services(services_in) {}
    void Write(const Record& record) override {
      const auto* answer = std::get_if<record::Answer>(&record.body);
      if (answer != nullptr && first.size() < kRoundTripSampleCount) first.push_back(answer->round_trip_ns);
      services.log().Write(record);
    }
    NodeServices& services;
    std::vector<TimeNs> first;
  };

  NodeServices& services_;
  RoundTrips round_trips_{services_};
  BootTime now_ns_;     // shown last
  BootTime opened_ns_;  // when its ports to the client had been opened
  BootTime sent_until_ns_ = BootTime::Earliest();
  std::string client_id_;
  std::size_t place_ = 0;  // of the client in the scenario
  SerialBoard board_;  // on its cables, or a client node at their other end; names nothing when there is none
  bool has_board_;
  Scenario scenario_;
  std::optional<LocalLine> line_;
  std::optional<SendBacklog> backlog_;  // of a server that sends by itself
  OriginFinder origin_;
  std::optional<ReferenceTalk> reference_talk_;
  std::optional<ReferenceFramer> framer_;  // of references that come over the bus
  std::unique_ptr<link::Pty> plant_, base_station_;
  PortEnd client_, reference_;
  std::array<DeafReceiver, link::kDirectionCount> deaf_;  // that of kToPlant hears everything
  boost::asio::steady_timer timer_, boot_timer_;          // bytes that arrive; a board that has been reset
  std::unique_ptr<PtyCanary> canary_;
  std::optional<CpuWaitWatch> board_watch_;  // of a program of the user's that plays the board
  std::optional<BoardReset> reset_;
  std::optional<ResetListener> reset_listener_;  // of a board that is reset
  bool armed_ = false;
  // When the plant got the last bytes that it has not answered yet.
  BootTime asked_plant_ns_ = BootTime::Never();
  std::size_t actuators_bytes_ = 0;  // of the shortest message that carries them
  TimeNs next_sample_ns_ = 0;
  bool client_is_library_ = false, client_is_emulator_ = false;
  bool client_takes_bytes_ = false;  // one at a time
  bool judged_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::Reference> references_;
  dds::Subscriber<dds::RunState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeLinkRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<LinkRole>(services, options);
}

}  // namespace tiltproof::harness
