#include <deque>
#include <memory>
#include <vector>

#include "harness/node/roles.h"
#include "harness/run/message_receiver.h"
#include "harness/run/plant_server.h"
#include "harness/run/realtime/client_parts.h"
#include "link/serial_port.h"

namespace tiltproof::harness {
namespace {

// Longest time between two steps of the plant, which are equal parts of the control period.
constexpr TimeNs kTickPeriodMaxNs = 4 * kNsPerMs;

class PlantRole final : public Role {
 public:
  explicit PlantRole(NodeServices& services)
      : services_(services),
        states_(services.bus()),
        send_timer_(services.loop()),
        nodes_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnRoles(); })) {}

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& /*clients*/) override {
    loaded_ = loaded;
    server_.emplace(loaded_.scenario, *loaded_.model, services_.log(), faults::ScheduleUse{.grows = true});
    receivers_.clear();
    for (std::size_t client = 0; client < loaded_.scenario.client_count(); ++client)
      receivers_.emplace_back(*loaded_.scenario.link.protocol, link::Direction::kToPlant);
    no_counts_ = AllCounts(loaded_.scenario.client_count());
    return {};
  }

  void Arm(const Ports& ports) override {
    for (std::size_t client = 0; client < receivers_.size(); ++client) {
      auto& port = ports_.emplace_back(std::make_unique<link::SerialPort>(
          services_.loop(), FindPort(ports, PartName(loaded_.scenario, "plant", client)),
          loaded_.scenario.link.port_baud(), loaded_.scenario.link.character));
      port->Start([this, client](std::span<const std::uint8_t> bytes) { OnBytes(client, bytes); },
                  [this](const std::string& reason) {
                    services_.Fail(EndReason::kNodeLost, "the plant's port is gone: " + reason);
                  });
    }
  }

  void Start() override { SendOwn(services_.clock().Now()); }
  std::optional<TimeNs> DoneUntil(const faults::FaultType& type) override {
    if (!type.IsOneOf<faults::SensorKind, faults::ActuatorKind, faults::PlantKind>()) return std::nullopt;
    return server_->state().reached_ns;
  }
  void Inject(const faults::FaultSpec& fault) override { server_->Add(fault); }
  void Flush() override {
    if (server_->state().started()) server_->WriteActivations();
  }

  void Stop() override {
    timer_.reset();
    send_timer_.cancel();
    ports_.clear();
    server_->WriteTotals();
  }

 private:
  void OnBytes(std::size_t client, std::span<const std::uint8_t> bytes) {
    if (finished_) return;
    const BootTime now = services_.clock().Now();
    Advance(now);
    if (finished_) return;
    const bool was_started = server_->state().started();
    receivers_[client].Receive(bytes, [&](const link::Message& message) {
      server_->Receive(client, now, message,
                       [&](std::span<const std::uint8_t> frame) { ports_[client]->Write(frame); });
    });
    if (was_started || !server_->state().started()) return;
    const Origin origin = server_->state().origin;
    services_.lateness().origin = origin;
    services_.SetPhase(dds::Phase::kRunning, 0, origin, EndReason::kCompleted, "");
    // Between two requests of the client, which come just after a boundary of the grid of control periods.
    const TimeNs period_ns = loaded_.scenario.link.protocol->control_period_ns;
    ticks_per_period_ = (period_ns + kTickPeriodMaxNs - 1) / kTickPeriodMaxNs;
    const TimeNs tick_ns = period_ns / ticks_per_period_;
    timer_.emplace(services_, origin.ToBootTime(tick_ns / 2), tick_ns, [this](BootTime due) { Tick(due); });
    SendOwn(now);
    Publish(origin.boot_time());
  }

  // A role holds for commands that arrive after it. A board that has told none, also one that was started again, is not
  // active.
  void OnRoles() {
    for (const auto& state : nodes_.Take()) {
      const auto client = loaded_.scenario.FindClient(state.client_id);
      const bool of_client = !state.client_id.empty() && loaded_.scenario.has_several_clients();
      if (state.run_id != services_.run_id() || !of_client || !client || !server_ || finished_) continue;
      Advance(services_.clock().Now());
      const auto standby = static_cast<std::uint32_t>(ClientRole::kStandby);
      const auto role = state.role < 0 ? standby : static_cast<std::uint32_t>(state.role);
      if (!finished_) server_->NoteRole(*client, role);
    }
  }

  // Sends what the server sends by itself, and comes back for the next.
  void SendOwn(BootTime now) {
    if (finished_ || server_->state().next_send_ns == BootTime::Never()) return;
    Advance(now);
    if (finished_) return;
    server_->SendOwn(now, [this](std::size_t client, std::span<const std::uint8_t> frame) {
      ports_[client]->Write(frame);
    });
    const BootTime due = server_->state().next_send_ns;
    send_timer_.expires_at(services_.clock().ToSteady(due));
    send_timer_.async_wait(
        [this, due, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
          if (error || alive.expired()) return;
          const BootTime late = services_.clock().Now();
          services_.lateness().Note(due, late);
          SendOwn(late);
        });
  }

  void Tick(BootTime now) {
    Advance(now);
    server_->PollEvents();  // in real time only the plant's own faults wait, and they have heard it
    if (tick_count_++ % ticks_per_period_ == 0) Publish(now);
  }

  void Advance(BootTime now) {
    const PlantServer::State& state = server_->state();
    if (finished_ || !state.started()) return;
    const BootTime end = state.origin.ToBootTime(loaded_.scenario.end_ns());
    server_->Advance(std::min(now, end), no_counts_);
    if (now < end && !state.over) return;
    if (!state.over) server_->Finish(end, no_counts_);
    finished_ = true;
    timer_.reset();
    Publish(std::min(now, end));
    services_.SetPhase(dds::Phase::kFinished, state.over ? state.reached_ns : loaded_.scenario.end_ns(),
                       state.origin, state.end_reason, state.end_text);
  }

  void Publish(BootTime now) {
    dds::PlantState state;
    state.run_id = services_.run_id();
    state.sequence = ++sequence_;
    state.time_ns = server_->state().origin.SimulationTime(now);
    state.state = server_->Truth();
    state.in_force = server_->in_force();
    states_.Write(state);
  }

  NodeServices& services_;
  dds::Publisher<dds::PlantState> states_;
  LoadedScenario loaded_;
  std::optional<LocalPlantServer> server_;
  // One for each client, in the scenario's order.
  std::deque<MessageReceiver> receivers_;
  std::vector<std::unique_ptr<link::SerialPort>> ports_;
  AllCounts no_counts_;  // the link counters of a row are the link nodes' to tell
  std::optional<PeriodicTimer> timer_;
  boost::asio::steady_timer send_timer_;  // of what the server sends by itself
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  std::int64_t tick_count_ = 0, ticks_per_period_ = 1;
  std::int64_t sequence_ = 0;
  bool finished_ = false;
  dds::Subscriber<dds::RunState> nodes_;  // their roles
};

}  // namespace

std::unique_ptr<Role> MakePlantRole(NodeServices& services, const NodeOptions& /*options*/) {
  return std::make_unique<PlantRole>(services);
}

}  // namespace tiltproof::harness
