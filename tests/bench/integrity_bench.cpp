// Speed of `tiltproof integrity`: damaged frames of the sensors in a second, on one processor, for each kind of damage.
//
//   build/release/tests/bench/bench_integrity [--benchmark_...]
//
// items_per_second counts damaged frames. 1e10 frames on two processors in ten minutes need 8.3e6 of them.
#include <benchmark/benchmark.h>

#include "harness/integrity/damager.h"
#include "harness/integrity/integrity.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"

namespace {

using namespace tiltproof::harness;
namespace link = tiltproof::link;
using tiltproof::faults::Random;

std::shared_ptr<const link::Framing> FramingOf(std::int64_t number) {
  switch (number) {
    case 0:
      return link::MakeHdlcFraming(link::CheckKind::kFletcher16);
    case 1:
      return link::MakeCobsFraming(link::CheckKind::kCrc32IsoHdlc);
    default:
      return link::MakeLengthFraming({.sync = {0xAA, 0x55}}, link::CheckKind::kCrc16IbmSdlc);
  }
}

void Judge(benchmark::State& state, void (*damage)(Damager&, Random&)) {
  link::Protocol protocol = *FindProtocol("paper");
  protocol.framing = FramingOf(state.range(0));
  const link::CheckKind kind = *protocol.framing->check();
  const link::MessageType& type = *DefaultMessage(protocol);
  const CheckGroup group(kind, type.payload_bytes + link::CheckBytes(kind));
  Random random(1);
  const FrameSample sample(protocol, type, random);
  Damager damager(sample, group);
  for (auto _ : state) damage(damager, random);
  state.SetItemsProcessed(damager.counts().frames);
  state.SetLabel(std::string(protocol.framing->name()) + " " + std::string(Name(kind)));
}

void FourBits(Damager& damager, Random& random) { damager.JudgeWithWrongBits(random, 4); }
void SixteenBits(Damager& damager, Random& random) { damager.JudgeWithWrongBits(random, 16); }
void Burst(Damager& damager, Random& random) {
  damager.MakeBurst(random, 32);
  damager.Judge();
}
void Stuck(Damager& damager, Random& random) {
  damager.StickBytes(random, 2);
  damager.Judge();
}
void Swap(Damager& damager, Random& random) {
  damager.SwapBytes(random, 2);
  damager.Judge();
}
void Loss(Damager& damager, Random& random) { damager.JudgeWithLost(random, 2); }
void EnumeratedThree(Damager& damager, Random& random) {
  damager.JudgeAllFrom(random() % damager.bits_count(), 3);
}

BENCHMARK_CAPTURE(Judge, bits_4, FourBits)->DenseRange(0, 2);
BENCHMARK_CAPTURE(Judge, bits_16, SixteenBits)->DenseRange(0, 2);
BENCHMARK_CAPTURE(Judge, burst_32, Burst)->DenseRange(0, 2);
BENCHMARK_CAPTURE(Judge, stuck_2, Stuck)->DenseRange(0, 2);
BENCHMARK_CAPTURE(Judge, swap_2, Swap)->DenseRange(0, 2);
BENCHMARK_CAPTURE(Judge, loss_2, Loss)->DenseRange(0, 2);
BENCHMARK_CAPTURE(Judge, enumerate_3, EnumeratedThree)->DenseRange(0, 2)->Iterations(20);

}  // namespace

BENCHMARK_MAIN();
