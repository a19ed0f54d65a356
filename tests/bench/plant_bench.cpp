// Only the physics: a step, an observation, and the paper's spiral of 60 s with a double-precision
// controller.

#include <benchmark/benchmark.h>
#include <ode/ode.h>

#include <string>
#include <vector>

#include "plant/dynamics.h"
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

// A quadrotor is one rigid body: the least that ODE can step. StepOfAQuadrotor is to cost at most 1.3 times as much as
// BareOdeStepOfAQuadrotor, the same body and forces without the plant around them.
VehicleModel Quadrotor() {
  VehicleModel model;
  model.name = "quadrotor";
  model.base.link = "body";
  model.base.mass_kg = 1.2;
  model.base.inertia_kg_m2 = Eigen::Vector3d(0.012, 0.014, 0.021).asDiagonal();
  model.collision.kind = CollisionShape::Kind::kSphere;
  model.collision.size_m = {0.2, 0, 0};
  for (int i = 0; i < 4; ++i)
    model.rotors.push_back({.name = "m" + std::to_string(i),
                            .hinge = {},
                            .p_LR_m = {i < 2 ? 0.2 : -0.2, i % 2 == 0 ? 0.15 : -0.15, 0.03},
                            .direction = i == 0 || i == 3 ? 1.0 : -1.0,
                            .drag_ratio_m = 0.016,
                            .force_min_n = 0,
                            .force_max_n = 10,
                            .time_constant_up_s = 0.0125,
                            .time_constant_down_s = 0.025});
  model.hover = SolveHover(model);
  return model;
}

void StepOfAQuadrotor(benchmark::State& state) {
  const VehicleModel model = Quadrotor();
  Plant plant(model, {});
  const std::vector<double> input = model.HoverInput();
  int steps = 0;
  for (auto _ : state) {
    if (steps++ % kStepsPerHover == 0) plant.Reset({0, 0, 50}, {0, 0, 0});
    plant.Step(input);
  }
  if (plant.Event() != FlightEvent::kNone) state.SkipWithError("left the hover");
}
BENCHMARK(StepOfAQuadrotor);

void BareOdeStepOfAQuadrotor(benchmark::State& state) {
  const VehicleModel model = Quadrotor();
  Plant initialises_ode(model, {});
  const dWorldID world = dWorldCreate();
  dWorldSetGravity(world, 0, 0, -kGravity_m_s2);
  const dBodyID body = dBodyCreate(world);
  dMass mass;
  dMassSetParameters(&mass, model.base.mass_kg, 0, 0, 0, 0.012, 0.014, 0.021, 0, 0, 0);
  dBodySetMass(body, &mass);
  dBodySetGyroscopicMode(body, 1);
  dBodySetAutoDisableFlag(body, 0);
  const std::vector<double> input = model.HoverInput();
  for (auto _ : state) {
    for (std::size_t i = 0; i < model.rotors.size(); ++i) {
      const Rotor& rotor = model.rotors[i];
      dBodyAddRelForce(body, 0, 0, input[i]);
      dBodyAddRelTorque(body, rotor.p_LR_m.y() * input[i], -rotor.p_LR_m.x() * input[i],
                        rotor.direction * rotor.drag_ratio_m * input[i]);
    }
    dWorldStep(world, 0.004);
  }
  dWorldDestroy(world);
}
BENCHMARK(BareOdeStepOfAQuadrotor);

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
