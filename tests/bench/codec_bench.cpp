// Cost of the codec for a frame of 64 bytes of payload (a sensor reply). Beside it: what the machine needs to
// touch as many bytes at all.
//
//   build/release/tests/bench/bench_codec [--benchmark_...]
//
// The times are nanoseconds a frame; the last lines give each as a multiple of memcpy and of memchr in the
// same run.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "link/fletcher16.h"
#include "link/frame.h"

namespace {

using tiltproof::link::EncodedFrame;
using tiltproof::link::EncodeFrame;
using tiltproof::link::FrameBytesMax;

constexpr std::size_t kPayloadBytes = 64;
// So many different payloads that a branch predictor does not learn them by heart, so few that they stay in
// the L2 cache.
constexpr std::size_t kPayloadCount = 1024;

using Payload = std::array<std::uint8_t, kPayloadBytes>;

std::vector<Payload> RandomPayloads() {
  std::mt19937_64 engine(1);
  std::vector<Payload> payloads(kPayloadCount);
  for (Payload& payload : payloads) {
    for (std::uint8_t& byte : payload) byte = static_cast<std::uint8_t>(engine() >> 56);
  }
  return payloads;
}

// Every byte of the payload and of its check is escaped: 134 bytes on the wire.
std::vector<Payload> WorstPayloads() {
  Payload payload;
  payload.fill(0x7D);
  for (std::size_t i = 8; i < 38; ++i) payload[i] = 0x7E;
  return std::vector<Payload>(kPayloadCount, payload);
}

std::vector<std::uint8_t> Wire(const std::vector<Payload>& payloads) {
  std::vector<std::uint8_t> wire;
  for (const Payload& payload : payloads) {
    std::array<std::uint8_t, FrameBytesMax(kPayloadBytes)> buffer;
    const EncodedFrame frame = EncodeFrame(payload, buffer);
    wire.insert(wire.end(), frame.bytes.begin(), frame.bytes.end());
  }
  return wire;
}

// Runs `use` on every payload in turn, one frame an iteration.
template <class Use>
void ForEachPayload(benchmark::State& state, const std::vector<Payload>& payloads, Use use) {
  std::size_t next = 0;
  for (auto _ : state) {
    use(payloads[next]);
    next = (next + 1) % kPayloadCount;
  }
  state.SetItemsProcessed(state.iterations());
}

void Memcpy(benchmark::State& state) {
  Payload copy;
  ForEachPayload(state, RandomPayloads(), [&](const Payload& payload) {
    std::memcpy(copy.data(), payload.data(), payload.size());
    benchmark::DoNotOptimize(copy.data());
    benchmark::ClobberMemory();
  });
}

// Up to a flag that is not there before the end.
void Memchr(benchmark::State& state) {
  std::vector<Payload> payloads = RandomPayloads();
  for (Payload& payload : payloads) {
    for (std::uint8_t& byte : payload) byte = byte == 0x7E ? 0x7F : byte;
    payload.back() = 0x7E;
  }
  ForEachPayload(state, payloads, [](const Payload& payload) {
    benchmark::DoNotOptimize(std::memchr(payload.data(), 0x7E, payload.size()));
  });
}

void Fletcher(benchmark::State& state) {
  ForEachPayload(state, RandomPayloads(), [](const Payload& payload) {
    benchmark::DoNotOptimize(tiltproof::link::Fletcher16(payload));
  });
}

void Encode(benchmark::State& state, const std::vector<Payload>& payloads) {
  std::array<std::uint8_t, FrameBytesMax(kPayloadBytes)> buffer;
  ForEachPayload(state, payloads, [&](const Payload& payload) {
    benchmark::DoNotOptimize(EncodeFrame(payload, buffer));
    benchmark::ClobberMemory();
  });
}

// One long stream; an iteration takes one frame out of it.
void Decode(benchmark::State& state, const std::vector<Payload>& payloads) {
  const std::vector<std::uint8_t> wire = Wire(payloads);
  tiltproof::link::FrameDecoder decoder;
  std::span<const std::uint8_t> rest;
  for (auto _ : state) {
    auto event = decoder.Next(rest);
    if (!event) {
      rest = wire;
      event = decoder.Next(rest);
    }
    benchmark::DoNotOptimize(event->payload.data());
    benchmark::ClobberMemory();
  }
  if (decoder.Counts()[0] != static_cast<std::uint32_t>(state.iterations())) {
    state.SkipWithError("a frame was rejected");
  }
  state.SetItemsProcessed(state.iterations());
}

void DecodeSensors(benchmark::State& state) {
  tiltproof::Sensors sensors;
  for (const auto& field : tiltproof::kSensorFields) sensors.*field.in_float = 0.125F;
  const tiltproof::link::MessageBytes message = tiltproof::link::EncodeSensors(sensors);
  for (auto _ : state) {
    benchmark::DoNotOptimize(tiltproof::link::DecodeSensors(message.span(), sensors));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations());
}

BENCHMARK(Memcpy);
BENCHMARK(Memchr);
BENCHMARK(Fletcher);
BENCHMARK_CAPTURE(Encode, random, RandomPayloads());
BENCHMARK_CAPTURE(Encode, worst, WorstPayloads());
BENCHMARK_CAPTURE(Decode, random, RandomPayloads());
BENCHMARK_CAPTURE(Decode, worst, WorstPayloads());
BENCHMARK(DecodeSensors);

// The usual table, and the ratios below it.
class RatioReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      // The fastest repetition counts: a disturbance only slows a run down.
      if (run.error_occurred || run.run_type != Run::RT_Iteration) continue;
      const double time_ns = run.GetAdjustedCPUTime();
      const auto [place, is_new] = times_ns_.try_emplace(run.run_name.function_name, time_ns);
      if (!is_new && time_ns < place->second) place->second = time_ns;
    }
  }

  void Finalize() override {
    ConsoleReporter::Finalize();
    const auto memcpy_ns = times_ns_.find("Memcpy");
    const auto memchr_ns = times_ns_.find("Memchr");
    if (memcpy_ns == times_ns_.end() || memchr_ns == times_ns_.end()) return;
    std::printf("\n%-16s %10s %12s %12s\n", "per 64 bytes", "ns", "x memcpy", "x memchr");
    for (const auto& [name, time_ns] : times_ns_) {
      std::printf("%-16s %10.2f %12.2f %12.2f\n", name.c_str(), time_ns, time_ns / memcpy_ns->second,
                  time_ns / memchr_ns->second);
    }
  }

 private:
  std::map<std::string, double> times_ns_;
};

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
  return 0;
}
