// Only the physics: a step, an observation, and the paper's spiral of 60 s with a double-precision
// controller.

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "plant/lqr_design.h"
#include "plant/plant.h"
#include "tests/support/reference_controller.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

std::string Source(const char* path) { return std::string(TILTPROOF_SOURCE_DIR) + "/" + path; }

const VehicleModel& Model() {
  static const VehicleModel model = [] {
    std::vector<std::string> warnings;
    return LoadVehicle(Source("plant/models/tiltrotor.sdf"), {}, warnings);
  }();
  return model;
}

void StartAtHover(Plant& plant) {
  plant.Reset({0, 0, 50}, {Model().hover.roll_rad, Model().hover.pitch_rad, 0});
}

// The vehicle's hover is unstable without control: begin again before it leaves.
constexpr int kStepsPerHover = 1000;

void Step(benchmark::State& state) {
  Plant plant(Model(), {});
  const std::vector<double> input = Model().HoverInput();
  int steps = 0;
  for (auto _ : state) {
    if (steps++ % kStepsPerHover == 0) StartAtHover(plant);
    plant.Step(input);
  }
  if (plant.Event() != FlightEvent::kNone) state.SkipWithError("left the hover");
}
BENCHMARK(Step);

void StepAndState(benchmark::State& state) {
  Plant plant(Model(), {});
  const std::vector<double> input = Model().HoverInput();
  std::vector<double> row(Model().signals().states.size());
  int steps = 0;
  for (auto _ : state) {
    if (steps++ % kStepsPerHover == 0) StartAtHover(plant);
    plant.Step(input);
    plant.State(row);
    benchmark::DoNotOptimize(row.data());
  }
}
BENCHMARK(StepAndState);

void SpiralOf60s(benchmark::State& state) {
  const auto gain = testing::ReadGainCsv(Source("tests/golden/dlqr_gain_published.csv"));
  testing::TiltrotorPlant plant(Model(), {});
  for (auto _ : state) {
    plant.Reset({2, 0, 0.5}, {0, 0, 0});
    testing::ReferenceController controller(gain, {10.2751, 10.2799, 0, 0});
    for (int k = 0; k < 5000; ++k) {
      const ActuatorsTruth input = controller.Step(plant.State(), testing::Spiral(0.012 * k, true));
      for (int i = 0; i < 3; ++i) plant.Step(input);
    }
  }
  if (plant.Event() != FlightEvent::kNone) state.SkipWithError("did not fly");
  state.counters["real_time_factor"] =
      benchmark::Counter(60.0 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(SpiralOf60s)->Unit(benchmark::kMillisecond);

void Load(benchmark::State& state) {
  for (auto _ : state) {
    std::vector<std::string> warnings;
    benchmark::DoNotOptimize(LoadVehicle(Source("plant/models/tiltrotor.sdf"), {}, warnings));
  }
}
BENCHMARK(Load)->Unit(benchmark::kMillisecond);

void Design(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(DesignLqr(Model()));
}
BENCHMARK(Design)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tiltproof::plant

BENCHMARK_MAIN();
