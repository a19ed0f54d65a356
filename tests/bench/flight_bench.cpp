// The price of everything around the physics: the full lockstep loop against bare ODE stepping of the same
// flight, the engine against the same flights flown and scored in this process, and the trace as files, in one run.

#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <memory>
#include <string>
#include <vector>

#include "harness/client/library_client.h"
#include "harness/engine/engine.h"
#include "harness/live/row_ring.h"
#include "harness/report/packed_trace.h"
#include "harness/report/trace_csv.h"
#include "harness/run/flight.h"
#include "harness/score/score.h"
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

RunLog FlySpiral(double duration_s, RecordSink* observer = nullptr) {
  const Scenario scenario = Spiral(duration_s);
  FlightOptions options;
  options.observer = observer;
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

// The same with each row copied for a live page: what its viewers cost the flight.
void WatchedLoop(benchmark::State& state) {
  RowRing ring;
  struct Copier final : RecordSink {
    explicit Copier(RowRing& to_in) : to(to_in) {}
    void Write(const Record& record) override {
      if (const auto* row = std::get_if<record::Row>(&record.body)) to.Append(row->values);
    }
    RowRing& to;
  } copier(ring);
  for (auto _ : state) benchmark::DoNotOptimize(FlySpiral(kDuration_s, &copier).trace.row_count());
}
BENCHMARK(WatchedLoop)->Unit(benchmark::kMillisecond);

// Processor time in s of this process and of the children that it has waited for.
double ProcessorTime_s() {
  double sum_s = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    for (const timeval& time : {usage.ru_utime, usage.ru_stime})
      sum_s += static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
  }
  return sum_s;
}

constexpr int kFlightsCount = 20;

// Processor time per flight, with its score.
template <class FlyAll>
void TimeFlights(benchmark::State& state, const FlyAll& fly_all) {
  for (auto _ : state) {
    const double began_s = ProcessorTime_s();
    fly_all();
    state.SetIterationTime((ProcessorTime_s() - began_s) / kFlightsCount);
  }
  state.counters["flights_per_hour_and_core"] =
      benchmark::Counter(3600.0 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

void FlyAndScore(benchmark::State& state) {
  TimeFlights(state, [] {
    for (int i = 0; i < kFlightsCount; ++i)
      benchmark::DoNotOptimize(ScoreRun(Spiral(kDuration_s), FlySpiral(kDuration_s)).verdict);
  });
}
BENCHMARK(FlyAndScore)->UseManualTime()->Unit(benchmark::kMillisecond);

void FlyByEngine(benchmark::State& state, const HostLibrary& library) {
  const auto model = std::make_shared<const plant::VehicleModel>(Model());
  TimeFlights(state, [&] {
    Engine engine({.jobs_count = static_cast<int>(state.range(0))});
    for (int i = 0; i < kFlightsCount; ++i) {
      FlightJob job{.name = std::to_string(i),
                    .scenario = Spiral(kDuration_s),
                    .model = model,
                    .means = {},
                    .replay = {}};
      job.means.clients.all = library;
      engine.Submit(std::move(job));
    }
    while (!engine.idle()) engine.Poll();
  });
}
BENCHMARK_CAPTURE(FlyByEngine, shipped, HostLibrary{})
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
// A process for each flight.
BENCHMARK_CAPTURE(FlyByEngine, users, HostLibrary{TILTPROOF_FIRMWARE_LIBRARY})
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// The trace of the flight as a file, and back.
const Trace& FlownTrace() {
  static const Trace trace = FlySpiral(kDuration_s).trace;
  return trace;
}

void CountBytes(benchmark::State& state, const std::string& file) {
  state.counters["file_bytes"] = static_cast<double>(file.size());
}

void WriteTraceAsText(benchmark::State& state) {
  std::string file;
  for (auto _ : state) file = WriteTraceCsv(FlownTrace());
  CountBytes(state, file);
}
BENCHMARK(WriteTraceAsText)->Unit(benchmark::kMillisecond);

void WriteTracePacked(benchmark::State& state) {
  std::string file;
  for (auto _ : state) file = PackTrace(FlownTrace());
  CountBytes(state, file);
}
BENCHMARK(WriteTracePacked)->Unit(benchmark::kMillisecond);

void ReadTraceAsText(benchmark::State& state) {
  const std::string file = WriteTraceCsv(FlownTrace());
  for (auto _ : state) benchmark::DoNotOptimize(ReadTraceCsv(file).row_count());
}
BENCHMARK(ReadTraceAsText)->Unit(benchmark::kMillisecond);

void ReadTracePacked(benchmark::State& state) {
  const std::string file = PackTrace(FlownTrace());
  for (auto _ : state) benchmark::DoNotOptimize(UnpackTrace(file).trace.row_count());
}
BENCHMARK(ReadTracePacked)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tiltproof::harness

BENCHMARK_MAIN();
