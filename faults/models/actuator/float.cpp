#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class FloatingActuator : public ActuatorModel {
 public:
  explicit FloatingActuator(const SignalSetup& setup) : actuator_(ActuatorIndex(setup)) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override { input[actuator_] = 0; }

 private:
  std::size_t actuator_;
};

}  // namespace

FaultType ActuatorFloat() {
  return {.name = "actuator.float",
          .summary = "An actuator exerts nothing.",
          .semantics =
              "Models an actuator without power or with a sheared shaft, which follows the forces of "
              "others. In the window, the actuator's force or torque is 0, whatever is commanded. A "
              "servo's hinge then turns freely between its stops. A servo that is commanded by angle cannot "
              "float: `check` refuses it, because 0 is one of its angles. A smallest thrust above 0 that the "
              "vehicle's file gives still applies.",
          .source = "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 (float).",
          .parameters = {ActuatorParameter()},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
                                 return std::make_unique<FloatingActuator>(setup);
                               },
                               .needs_force = true}};
}

}  // namespace tiltproof::faults
