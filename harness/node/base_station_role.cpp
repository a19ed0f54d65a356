#include "harness/node/origin_follower.h"
#include "harness/node/reference_sender.h"
#include "harness/node/roles.h"
#include "harness/reference/trajectory.h"

namespace tiltproof::harness {
namespace {

// Follows the simulation's clock, which the plant node publishes once a period: r(t) goes out at every
// boundary of the protocol's periods, by this node's own clock set to the simulation's.
class BaseStationRole final : public Role {
 public:
  explicit BaseStationRole(NodeServices& services)
      : services_(services),
        sender_(services),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& /*clients*/) override {
    trajectory_.emplace(loaded.scenario.reference);
    protocol_ = loaded.scenario.link.protocol;
    return {};
  }
  void Arm(const Ports& ports) override { sender_.Open(ports, protocol_); }
  void Start() override {}
  void Flush() override {}
  void Stop() override {
    timer_.reset();
    stopped_ = true;
    sender_.Close();
  }

 private:
  void OnStates() {
    const BootTime now = services_.clock().Now();
    for (const auto& state : states_.Take()) {
      if (stopped_ || state.run_id != services_.run_id()) continue;
      if (origin_.Hear(now, state.time_ns)) Follow(now);
    }
  }

  void Follow(BootTime now) {
    services_.lateness().origin = origin_.origin();
    if (!timer_) SendAt(origin_.origin().SimulationTime(now));
    SetTimer(now);
  }

  void SetTimer(BootTime now) {
    const TimeNs period = protocol_->control_period_ns;
    const Origin& origin = origin_.origin();
    const BootTime next = origin.ToBootTime((origin.SimulationTime(now) / period + 1) * period);
    timer_.emplace(services_, next, period, [this, period](BootTime due) {
      // Sends the reference of the boundary just reached, however late the timer is.
      SendAt(origin_.origin().SimulationTime(due) / period * period);
    });
  }

  void SendAt(TimeNs time_ns) { sender_.Send(time_ns, trajectory_->At(time_ns)); }

  NodeServices& services_;
  ReferenceSender sender_;
  std::shared_ptr<const link::Protocol> protocol_;
  std::optional<Trajectory> trajectory_;
  std::optional<PeriodicTimer> timer_;
  OriginFollower origin_;
  bool stopped_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::PlantState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeBaseStationRole(NodeServices& services, const NodeOptions& /*options*/) {
  return std::make_unique<BaseStationRole>(services);
}

}  // namespace tiltproof::harness
