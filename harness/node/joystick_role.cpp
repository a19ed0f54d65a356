#include <fmt/format.h>

#include "harness/node/joystick_input.h"
#include "harness/node/joystick_reference.h"
#include "harness/node/reference_sender.h"
#include "harness/node/roles.h"
#include "harness/reference/trajectory.h"

namespace tiltproof::harness {
namespace {

// A person flies: from the start of the scenario's reference, as the sticks say. It begins with the flight.
class JoystickRole final : public Role {
 public:
  JoystickRole(NodeServices& services, const NodeOptions& options)
      : services_(services),
        source_(options.joystick_source),
        sender_(services),
        states_(services.bus(), services.members(), InLoop(services.loop(), alive_, [this] { OnStates(); })) {
  }

  Ports Prepare(const LoadedScenario& loaded, const ClientKinds& /*clients*/) override {
    input_ = OpenJoystick(source_);
    protocol_ = loaded.scenario.link.protocol;
    reference_.emplace(Trajectory(loaded.scenario.reference).At(kPowerOn), JoystickLimits{});
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
    for (const auto& state : states_.Take()) {
      if (stopped_ || timer_ || state.run_id != services_.run_id()) continue;
      const BootTime now = services_.clock().Now();
      last_ns_ = now - state.time_ns;
      origin_ = services_.lateness().origin = Origin(last_ns_);
      timer_.emplace(services_, now, protocol_->control_period_ns, [this](BootTime due) { Send(due); });
    }
  }

  void Send(BootTime now) {
    const TimeNs time_ns = origin_.SimulationTime(now);
    const JoystickAxes axes = input_->Read(time_ns);
    if (!input_->lost().empty() && !told_lost_) {
      told_lost_ = true;
      services_.Note(time_ns, "joystick_lost", input_->lost());
    }
    sender_.Send(time_ns, reference_->Step(axes, now - last_ns_));
    last_ns_ = now;
  }

  NodeServices& services_;
  std::string source_;
  ReferenceSender sender_;
  std::shared_ptr<const link::Protocol> protocol_;
  std::unique_ptr<JoystickInput> input_;
  std::optional<JoystickReference> reference_;
  std::optional<PeriodicTimer> timer_;
  Origin origin_;  // by this node's clock
  BootTime last_ns_;
  bool stopped_ = false, told_lost_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
  dds::Subscriber<dds::PlantState> states_;
};

}  // namespace

std::unique_ptr<Role> MakeJoystickRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<JoystickRole>(services, options);
}

}  // namespace tiltproof::harness
