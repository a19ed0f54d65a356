// The price of everything around the physics: the full lockstep loop against bare ODE stepping of the same
// flight, in one run.

#include <benchmark/benchmark.h>

#include <string>

#include "harness/client/library_client.h"
#include "harness/run/flight.h"
#include "plant/plant.h"

namespace tiltproof::harness {
namespace {

constexpr double kDuration_s = 60;

const plant::VehicleModel& Model() {
  static const plant::VehicleModel model = [] {
    std::vector<std::string> warnings;
    return plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/tiltrotor.sdf", {},
                              warnings);
  }();
  return model;
}

Scenario Spiral(double duration_s) {
  Scenario scenario;
  scenario.name = "spiral";
  scenario.duration_ns = FromSeconds(duration_s);
  scenario.initial_position_m = {2, 0, 0.5};
  return scenario;
}

RunLog FlySpiral(double duration_s) {
  const Scenario scenario = Spiral(duration_s);
  FlightOptions options;
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    return LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, scenario.firmware, scenario.link.protocol->name,
                             std::move(host));
  };
  return Fly(scenario, Model(), options);
}

// The inputs of the real flight, replayed on the bare plant: the same trajectory without firmware, line,
// faults and log.
void BarePlant(benchmark::State& state) {
  const RunLog log = FlySpiral(kDuration_s);
  const VehicleSignals signals = Model().signals();
  std::vector<std::vector<double>> inputs;
  for (std::size_t r = 0; r < log.trace.row_count(); ++r) {
    std::vector<double>& input = inputs.emplace_back();
    for (const Signal& signal : signals.inputs)
      input.push_back(log.trace.at(r, *log.trace.Find(signal.name)));
  }
  for (auto _ : state) {
    plant::Plant plant(Model(), {});
    plant.Reset({2, 0, 0.5}, {0, 0, 0});
    // On the wire an input takes force one step after its row began: the row that shows it is the next one.
    for (std::size_t r = 0; r + 1 < inputs.size(); ++r) {
      plant.Step(inputs[r]);
      plant.Step(inputs[r + 1]);
      plant.Step(inputs[r + 1]);
    }
    std::vector<double> at_end(signals.states.size());
    plant.State(at_end);
    if (at_end[*signals.states.Find("x_m")] !=
        log.trace.at(log.trace.row_count() - 1, *log.trace.Find("x_m"))) {
      state.SkipWithError("not the same flight");
      break;
    }
  }
  state.counters["x_real_time"] =
      benchmark::Counter(kDuration_s, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(BarePlant)->Unit(benchmark::kMillisecond);

void FullLoop(benchmark::State& state) {
  const auto duration_s = static_cast<double>(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(FlySpiral(duration_s).trace.row_count());
  state.counters["x_real_time"] =
      benchmark::Counter(duration_s, benchmark::Counter::kIsIterationInvariantRate);
}
// Cost must grow linearly with flight time.
BENCHMARK(FullLoop)->Arg(60)->Arg(120)->Arg(240)->Arg(480)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tiltproof::harness

BENCHMARK_MAIN();
