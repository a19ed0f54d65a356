#include "harness/run/client_channel.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "harness/client/firmware_guard.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

// A client may say that it transmits later within its call, but not by more than this.
constexpr TimeNs kTransmitAheadMax = kNsPerS;
// A client that asks to be woken more often than this within a control period lets no time pass: that is every 0.6 us.
constexpr int kWakesPerPeriodMax = 20'000;

}  // namespace

namespace {

// Commands of these faults to a client's board.
std::vector<faults::DeviceCommand> CommandsOf(const std::vector<faults::FaultSpec>& faults,
                                              const Scenario& scenario, std::size_t client) {
  auto commands = faults::DeviceCommands(faults, scenario.seed_of(client));
  std::erase_if(commands, [&](const faults::DeviceCommand& command) {
    const std::string& whose = faults[command.fault].client;
    return !whose.empty() && whose != scenario.client_id(client);
  });
  return commands;
}

}  // namespace

std::vector<faults::DeviceCommand> ClientCommands(const Scenario& scenario, std::size_t client) {
  return CommandsOf(scenario.faults, scenario, client);
}

ClientChannel::ClientChannel(const Scenario& scenario, std::size_t client, Line& line, RecordSink& sink,
                             Callbacks callbacks, std::vector<LinePort> ports, const faults::ScheduleUse& use)
    : scenario_(scenario),
      index_(client),
      line_(line),
      ports_(std::move(ports)),
      callbacks_(std::move(callbacks)),
      faults_(ClientFaults(scenario, client, nullptr, use)),
      records_(sink, client),
      commands_(ClientCommands(scenario, client)),
      reference_talk_(*scenario.link.protocol) {}

void ClientChannel::PowerOn(
    const std::function<std::unique_ptr<Client>(std::size_t client, ClientHost)>& make) {
  client_ = make(
      index_, {.transmit = [this](Uart uart, BootTime now, std::span<const std::uint8_t> bytes) -> BootTime {
                 return Transmit(uart, now, bytes);
               },
               .log =
                   [this](BootTime now, std::string_view text) {
                     if (firmware_log_bytes_ > kFirmwareLogBytesMax) return;
                     firmware_log_bytes_ += text.size();
                     records_.Write(now, record::FirmwareText{std::string(text)});
                   },
               .event = [this](const DeviceEvent& event) { OnEvent(event); }});
  wake_ns_ = client_->Start(BootTime());
}

BootTime ClientChannel::Transmit(Uart uart, BootTime now, std::span<const std::uint8_t> bytes) {
  // The reference line has no way back: what the client sends there ends at its pin.
  if (uart == Uart::kReference) {
    reference_talk_.Hear(bytes);
    return now;
  }
  const std::size_t port = static_cast<std::size_t>(uart) - static_cast<std::size_t>(Uart::kFirstLine);
  if (uart != Uart::kMain && port >= ports_.size()) return now;  // nothing is connected
  const BootTime at = std::clamp(now, now_ns_, now_ns_ + kTransmitAheadMax);
  if (exists() && client_->RunsOn()) callbacks_.before_ahead(*this, at);
  const BootTime sent = uart == Uart::kMain ? line_.Transmit(Direction::kToPlant, at, bytes)
                                            : ports_[port].line->Transmit(ports_[port].end, at, bytes);
  callbacks_.on_news();
  return sent;
}

BootTime ClientChannel::Next() const {
  BootTime next = wake_ns_;
  for (const Direction direction : {Direction::kToPlant, Direction::kToClient, Direction::kReference})
    next = std::min(next, line_.NextArrival(direction));
  for (const LinePort& port : ports_) next = std::min(next, port.line->NextArrival(port.end));
  return next;
}

void ClientChannel::BeginTurn(BootTime now) {
  now_ns_ = now;
  commanded_ = false;
  if (now - period_begin_ns_ >= scenario_.link.protocol->control_period_ns) {
    period_begin_ns_ = now;
    wakes_count_ = 0;
  }
  if (now >= wake_ns_ && ++wakes_count_ > kWakesPerPeriodMax)
    throw FirmwareTrouble(
        true,
        fmt::format("the firmware lets no time pass: it wants to be woken again and again, {} times from "
                    "{:.9f} s to {:.9f} s after power-on",
                    wakes_count_, ToSeconds(period_begin_ns_.ns()), ToSeconds(now.ns())));
  // Without faults it is the firmware that sends, or asks for, more than the line carries.
  if (const auto& overfull = line_.overfull(); overfull && !overfull->by_faults)
    throw FirmwareTrouble(true, overfull->text);
  for (const LinePort& port : ports_)
    if (const auto& overfull = port.line->overfull(port.end); overfull && !overfull->by_faults)
      throw FirmwareTrouble(true, overfull->text);
}

void ClientChannel::Command(Origin origin) {
  origin_ = origin;
  faults_.SetOrigin(origin);
  records_.SetOrigin(origin);
  client_->Command(commands_, origin);
  commanded_ = true;
}

void ClientChannel::Add(const faults::FaultSpec& fault, std::size_t place) {
  faults_.Add(fault);
  auto commands = CommandsOf({fault}, scenario_, index_);
  for (faults::DeviceCommand& command : commands) command.fault = place;
  if (commands.empty() || is_lost()) return;
  if (origin_.known()) {
    const BootTime wake = client_->Add(commands);
    if (!client_->RunsOn()) wake_ns_ = wake;
    return;
  }
  commands_.insert(commands_.end(), commands.begin(), commands.end());
  std::ranges::stable_sort(commands_, {}, &faults::DeviceCommand::at_ns);
}

void ClientChannel::CutCommands(const Future& future) {
  const auto is_cut = [&](const faults::DeviceCommand& command) {
    return std::ranges::find(future.cut, command.fault) != future.cut.end();
  };
  std::erase_if(commands_, [&](const faults::DeviceCommand& command) {
    return is_cut(command) && command.at_ns >= future.from_ns;
  });
  for (faults::DeviceCommand& command : commands_)
    if (is_cut(command)) command.until_ns = std::min(command.until_ns, future.from_ns);
}

void ClientChannel::Lose(const FirmwareTrouble& trouble) {
  loss_ = {.hung = trouble.hung, .text = trouble.what(), .end = trouble.end};
  lost_ns_ = now_ns_;
  wake_ns_ = BootTime::Never();
  records_.Write(now_ns_,
                 record::Event{trouble.hung ? kClientHungEvent : kClientCrashedEvent, trouble.what()});
}

void ClientChannel::Run(BootTime now, BootTime horizon) {
  if (is_lost()) {
    // Its pins hear on, but nothing reads them.
    for (const Direction direction : {Direction::kReference, Direction::kToClient})
      while (line_.TakePiece(direction, now)) callbacks_.on_news();
    for (const LinePort& port : ports_)
      while (port.line->TakePiece(port.end, now)) callbacks_.on_news();
    return;
  }
  const bool runs_on = client_->RunsOn();
  const bool delivered = Deliver(runs_on ? horizon : now);
  if (runs_on || delivered || commanded_ || now >= wake_ns_) wake_ns_ = client_->Grant(now, horizon);
}

// The client gets every byte that has arrived, whole frame or not: it may flush what it holds at any tick.
bool ClientChannel::Deliver(BootTime until) {
  bool delivered = false;
  // References first: r(t_k) is there before the sensor reply of the same period.
  for (const Direction direction : {Direction::kReference, Direction::kToClient}) {
    const Uart uart = direction == Direction::kReference ? Uart::kReference : Uart::kMain;
    while (const auto piece = line_.TakePiece(direction, until)) {
      delivered = true;
      faults_.MarkReceived(direction, piece->arrival_ns, piece->bytes, marks_, piece->parity_errors);
      client_->Receive(uart, piece->arrival_ns, piece->bytes, marks_);
    }
  }
  for (std::size_t i = 0; i < ports_.size(); ++i)
    while (const auto piece = ports_[i].line->TakePiece(ports_[i].end, until)) {
      delivered = true;
      client_->Receive(LineUart(i), piece->arrival_ns, piece->bytes, piece->marks);
    }
  callbacks_.on_news();
  return delivered;
}

std::vector<faults::FaultEvent> ClientChannel::PollEvents() {
  std::vector<faults::FaultEvent> of_line = line_.PollEvents(), of_client = faults_.PollEvents();
  line_.Hear(of_client);
  faults_.Hear(of_line);
  of_line.insert(of_line.end(), of_client.begin(), of_client.end());
  return of_line;
}

void ClientChannel::Hear(std::span<const faults::FaultEvent> events) {
  line_.Hear(events);
  faults_.Hear(events);
}

void ClientChannel::OnEvent(const DeviceEvent& event) {
  if (event.kind == kStackUseEvent) {
    totals_.stacks = event.stacks;
    return;
  }
  if (event.kind == kComputesEvent) {
    totals_.deadline_missed_count = 0;
    return;
  }
  if (event.kind == kDeadlineMissedEvent && totals_.deadline_missed_count) ++*totals_.deadline_missed_count;
  records_.Write(event.time_ns, record::Event{event.kind, event.text});
  receive_overruns_count_ += event.overruns_count;
  if (!event.block.empty()) totals_.unmodelled_blocks.push_back(event.block);
  if (event.fault && *event.fault < faults_.ActivationCounts().size())
    faults_.Count(*event.fault, origin_.OrPowerOn().SimulationTime(event.time_ns), event.text);
}

void ClientChannel::AskStatus() {
  if (const auto status = client_->Status()) totals_.failsafe_entered_count = status->failsafe_count;
}

void ClientChannel::Finish(Origin origin) {
  records_.SetOrigin(origin.OrPowerOn());
  if (client_ != nullptr && client_->RunsOn()) totals_.receive_overruns_count = receive_overruns_count_;
  if (const std::string talk = reference_talk_.Trouble(); !talk.empty() && !origin.known())
    records_.Write(TimeNs{0}, record::Event{kLineTroubleEvent, talk});
  for (faults::Activation& activation : faults_.TakeActivations(origin)) {
    const TimeNs time_ns = activation.time_ns;
    records_.Write(time_ns, std::move(activation));
  }
  if (loss_) {
    loss_->time_ns = origin.OrPowerOn().SimulationTime(lost_ns_);
    totals_.loss = std::move(loss_);
  }
  records_.Write(now_ns_, record::ActivationCounts{faults_.ActivationCounts()});
  records_.Write(now_ns_, std::move(totals_));
}

}  // namespace tiltproof::harness
