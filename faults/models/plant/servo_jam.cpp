#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class ServoJam : public PlantModel {
 public:
  explicit ServoJam(const SignalSetup& setup) { disturbance_.hinges[JointIndex(setup)].held = true; }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantServoJam() {
  return {
      .name = "plant.servo_jam",
      .summary = "A servo jams.",
      .semantics =
          "Models a seized gear or a foreign body in the hinge. In every step that the trigger picks, the "
          "joint keeps the angle that it had when the jam began. It holds against torques of the servo and "
          "the airframe up to 100 N m. A joint that was turning stops within one step. What the servo "
          "commands is still in the trace. After the window, the joint is free at once. Each time that the "
          "joint jams is one activation.",
      .source = "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 (lock in place).",
      .parameters = {JointParameter()},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
        return std::make_unique<ServoJam>(setup);
      }}};
}

}  // namespace tiltproof::faults
