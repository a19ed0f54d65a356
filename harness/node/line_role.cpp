#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "harness/node/deaf_receiver.h"
#include "harness/node/port_end.h"
#include "harness/node/roles.h"
#include "harness/run/board_line.h"
#include "harness/run/realtime/client_parts.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

class LineRole final : public Role {
 public:
  LineRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        id_(options.id),
        devices_(options.end_devices),
        timer_(services.loop()),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& clients) override {
    scenario_ = loaded.scenario;
    place_ = LinePlace(scenario_, id_);
    const LineEntry& entry = scenario_.lines[place_];
    Ports ports;
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      End& end = ends_[i];
      const std::size_t client = scenario_.FindClient(entry.between[i]).value();
      const bool is_emulated =
          i < clients.size() && clients[i] && std::holds_alternative<EmulatedImage>(*clients[i]);
      end.takes_bytes = is_emulated || link::IsSocketName(devices_[i]);
      if (is_emulated) end.deaf = DeafReceiver(scenario_, client);
      end.port.Open(services_,
                    {.device = devices_[i],
                     .baud = entry.baud,
                     .for_emulator = is_emulated,
                     .name = LinePortName(entry.id, entry.between[i]),
                     .client = client},
                    ports);
    }
    // At a real port the hardware takes the bytes' time.
    const bool hardware = std::ranges::any_of(ends_, [](const End& end) { return end.port.TakesByteTime(); });
    line_.emplace(scenario_, place_, services_.log(), !hardware, faults::ScheduleUse{.grows = true});
    return ports;
  }

  void Arm(const Ports& /*ports*/) override {
    armed_ = true;
    for (std::size_t i = 0; i < ends_.size(); ++i)
      if (ends_[i].port.line != nullptr) Listen(i);
  }

  // An emulator may begin as soon as its sockets are taken: then everybody has to be ready.
  void Start() override {
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      if (ends_[i].port.line != nullptr) continue;
      ends_[i].port.ConnectSocket(services_.loop());
      Listen(i);
    }
  }

  void Flush() override {
    if (line_->origin().known()) line_->WriteActivations();
  }

  // Bytes that were sent have had their faults, also where they still wait for the line.
  std::optional<TimeNs> DoneUntil(const faults::FaultType& type) override {
    if (!type.IsOneOf<faults::WireKind>()) return std::nullopt;
    return line_->origin().known() ? line_->origin().SimulationTime(std::max(Now(), sent_until_ns_)) : 0;
  }

  void Inject(const faults::FaultSpec& fault) override { line_->Add(fault); }

  void Stop() override {
    armed_ = false;
    timer_.cancel();
    const BootTime now = Now();
    const Origin origin = line_->origin().known() ? line_->origin() : Origin(now);
    // Without t = 0 all records count from now.
    if (!line_->origin().known()) line_->SetOrigin(origin);
    line_->Finish(std::min(now, origin.ToBootTime(scenario_.end_ns())));
  }

 private:
  struct End {
    PortEnd port;
    DeafReceiver deaf;
    bool takes_bytes = false;  // one at a time, as an emulator does
    bool overfull = false;     // what it sends is not carried any more
  };

  void Listen(std::size_t end) {
    ends_[end].port.line->Start([this, end](std::span<const std::uint8_t> bytes) { Transmit(end, bytes); },
                                [this, end](const std::string& reason) {
                                  const std::string& client = scenario_.lines[place_].between[end];
                                  const std::string text = "the port of '" + client + "' on the line '" +
                                                           id_ + "' is gone: " + reason;
                                  const Origin origin = line_->origin();
                                  services_.Note(origin.known() ? origin.SimulationTime(Now()) : 0,
                                                 "port_lost", text, scenario_.FindClient(client));
                                  ends_[end].port.line = nullptr;
                                  services_.FailClient(client, EndReason::kNodeLost, text);
                                });
  }

  // Bytes do not arrive before they were sent, not even when a fault sets the clock.
  BootTime Now() { return now_ns_ = std::max(now_ns_, services_.clock().Now()); }

  void OnStates() {
    for (const auto& state : states_.Take())
      // Only the plant's state has it; perhaps only the last state has arrived.
      if (armed_ && state.run_id == services_.run_id() && state.origin_ns != 0 && !line_->origin().known()) {
        line_->SetOrigin(Origin(BootTime(state.origin_ns)));
        services_.lateness().origin = line_->origin();
      }
  }

  void Transmit(std::size_t end, std::span<const std::uint8_t> bytes) {
    if (!armed_ || ends_[end].overfull) return;
    sent_until_ns_ = std::max(sent_until_ns_, line_->Transmit(end, Now(), bytes));
    Pump();
    for (std::size_t from = 0; from < ends_.size(); ++from) {
      const auto& overfull = line_->overfull(from);
      if (!overfull || std::exchange(ends_[from].overfull, true)) continue;
      // By faults it is no client's doing.
      const std::string client = overfull->by_faults ? "" : scenario_.lines[place_].between[from];
      services_.FailClient(client, overfull->by_faults ? EndReason::kLineOverfull : EndReason::kFirmwareHung,
                           overfull->text);
    }
  }

  // Hands over what has arrived, and comes back for the rest.
  void Pump() {
    const BootTime now = Now();
    BootTime next = BootTime::Never();
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      End& end = ends_[i];
      while (const auto piece = line_->TakePiece(i, now)) {
        services_.lateness().Note(piece->arrival_ns, now);
        std::span<const std::uint8_t> bytes = piece->bytes;
        if (line_->origin().known())
          bytes =
              bytes.first(end.deaf.Keeps(line_->origin().SimulationTime(piece->arrival_ns), bytes.size()));
        if (end.port.line != nullptr && !bytes.empty()) end.port.line->Write(bytes);
      }
      next = std::min(next, NextHandOver(line_->NextArrival(i), end.takes_bytes, now));
    }
    timer_.cancel();
    if (next == BootTime::Never()) return;
    timer_.expires_at(services_.clock().ToSteady(next));
    timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
      if (!error && !alive.expired() && armed_) Pump();
    });
  }

  NodeServices& services_;
  std::string id_;
  std::array<std::string, 2> devices_;
  Scenario scenario_;
  std::size_t place_ = 0;  // of the line in the scenario
  std::array<End, 2> ends_;
  std::optional<BoardLine> line_;
  BootTime now_ns_;  // shown last
  BootTime sent_until_ns_ = BootTime::Earliest();
  boost::asio::steady_timer timer_;  // bytes that arrive
  bool armed_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::RunState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeLineRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<LineRole>(services, options);
}

}  // namespace tiltproof::harness
