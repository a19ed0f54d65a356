#include <algorithm>
#include <cstdlib>

#include "harness/node/reference_sender.h"
#include "harness/node/roles.h"
#include "harness/reference/trajectory.h"

namespace tiltproof::harness {
namespace {

constexpr TimeNs kOriginTolerance = 100 * kNsPerUs;

// Follows the simulation's clock, which the plant node publishes once a period: r(t) goes out at every
// boundary of the protocol's periods, by this node's own clock set to the simulation's.
class BaseStationRole final : public Role {
 public:
  explicit BaseStationRole(NodeServices& services)
      : services_(services),
        sender_(services),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const std::optional<ClientSpec>& /*client*/) override {
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
      Follow(now, now - state.time_ns);
    }
  }

  // Messages are late, never early: the earliest origin of the last second or two is the best, and a clock that
  // drifts is followed.
  void Follow(BootTime now, BootTime origin) {
    if (now >= window_end_ns_) {
      last_window_ns_ = window_ns_;
      window_ns_ = BootTime::Never();
      window_end_ns_ = now + kNsPerS;
    }
    window_ns_ = std::min(window_ns_, origin);
    const BootTime best = std::min(window_ns_, last_window_ns_);
    if (timer_ && std::abs(best - origin_.boot_time()) < kOriginTolerance) return;
    origin_ = services_.lateness().origin = Origin(best);
    if (!timer_) SendAt(origin_.SimulationTime(now));
    SetTimer(now);
  }

  void SetTimer(BootTime now) {
    const TimeNs period = protocol_->control_period_ns;
    const BootTime next = origin_.ToBootTime((origin_.SimulationTime(now) / period + 1) * period);
    timer_.emplace(services_, next, period, [this, period](BootTime due) {
      // Sends the reference of the boundary just reached, however late the timer is.
      SendAt(origin_.SimulationTime(due) / period * period);
    });
  }

  void SendAt(TimeNs time_ns) { sender_.Send(time_ns, trajectory_->At(time_ns)); }

  NodeServices& services_;
  ReferenceSender sender_;
  std::shared_ptr<const link::Protocol> protocol_;
  std::optional<Trajectory> trajectory_;
  std::optional<PeriodicTimer> timer_;
  Origin origin_;  // by this node's clock
  BootTime window_ns_ = BootTime::Never(), last_window_ns_ = BootTime::Never(),
           window_end_ns_ = BootTime::Earliest();
  bool stopped_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::PlantState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeBaseStationRole(NodeServices& services, const NodeOptions& /*options*/) {
  return std::make_unique<BaseStationRole>(services);
}

}  // namespace tiltproof::harness
