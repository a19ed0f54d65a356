#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Null : public SensorModel {
 public:
  void Act(std::span<double> /*values*/, const SampleContext& /*context*/) override {}
};

}  // namespace

FaultType HarnessNull() {
  return {.name = "harness.null",
          .summary = "Changes nothing: a flight with it must equal one without.",
          .semantics =
              "Models nothing in the world: it tests the harness. The fault passes through triggers and "
              "records like any fault of the sensors, and counts as activated in every sample that the "
              "trigger picks.",
          .source =
              "Segura et al., A Survey on Metamorphic Testing, IEEE Transactions on Software Engineering "
              "42(9), 2016 (two executions whose outputs must be equal).",
          .kind = SensorKind{.make = [](const SignalSetup&) -> std::unique_ptr<SensorModel> {
                               return std::make_unique<Null>();
                             },
                             .always_counts = true}};
}

}  // namespace tiltproof::faults
