// A fault that is added in mid-flight, or given to a schedule in which it was open, acts as if the schedule had been made
// with it: for every type.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "faults/schedule.h"
#include "tests/faults/faulty_flight.h"

namespace tiltproof::faults {
namespace {

// The period in which the fault is added, of kFrames.
constexpr std::int64_t kAdded = 900;

// Others of each layer and kind, which act before and after it.
std::vector<FaultSpec> Others() {
  return {At(Spec("frame.delay",
                  {{"mean_ms", 3.0}, {"jitter_ms", 2.0}, {"distribution", std::string("uniform")}}, "later"),
             0),
          At(Spec("wire.bit_error", {{"ber", 1e-3}}, "flips"), 0),
          At(Spec("frame.duplicate", {{"probability", 0.2}}, "twice"), 0),
          At(Spec("sensor.bias", {{"signal", std::string("x_m")}, {"offset", 0.3}}, "off"), 0)};
}

struct FlownInTurn : Outcome {
  std::vector<std::vector<ReceiveMark>> marks;
};

// All periods, in the order of a flight. `added`: behind period kAdded. `given`: before.
FlownInTurn FlyInTurn(FaultSchedule schedule, const FaultSpec* added, const FaultSpec* given = nullptr) {
  schedule.SetOrigin(kOriginAtPowerOn);
  FlownInTurn outcome;
  link::ChunkFilter* filter = schedule.Filter(link::Direction::kToClient);
  for (std::int64_t n = 0; n < kFrames; ++n) {
    if (n == kAdded && added != nullptr) schedule.Add(*added);
    if (n == kAdded - 2 && given != nullptr) schedule.Give(*given);
    outcome.sensors.push_back(Sample(n));
    EditSensors(schedule, n * kPeriod, outcome.sensors.back());
    outcome.actuators.push_back(Command(n));
    EditActuators(schedule, n * kPeriod, outcome.actuators.back());
    outcome.disturbances.push_back(schedule.DisturbanceOf(n * kPeriod));
    outcome.frames.push_back({Frame(n)});
    filter->Apply(outcome.frames.back());
    for (link::Chunk& chunk : schedule.TakeSentBack(link::Direction::kToClient))
      outcome.frames.back().push_back(std::move(chunk));
    schedule.MarkReceived(link::Direction::kToClient, kOriginAtPowerOn.ToBootTime(n * kPeriod + kNsPerMs),
                          Frame(n).bytes, outcome.marks.emplace_back());
  }
  outcome.counts = schedule.ActivationCounts();
  return outcome;
}

void ExpectSameAsFromTheBeginning(FaultSpec added) {
  added.id = "added";
  added.start_ns = kAdded * kPeriod;
  std::vector<FaultSpec> others = Others(), all = others;
  all.push_back(added);
  const FaultSchedule::Place place{.protocol = ProtocolFor(all), .signals = TiltrotorSignals()};
  FaultSchedule::Place growing = place;
  growing.use.grows = true;
  const FlownInTurn whole = FlyInTurn(FaultSchedule(all, 7, place), nullptr);
  const FlownInTurn grown = FlyInTurn(FaultSchedule(others, 7, growing), &added);
  EXPECT_TRUE(SameOutcome(whole, grown)) << added.type;
  EXPECT_EQ(whole.marks, grown.marks) << added.type;
  EXPECT_EQ(whole.counts, grown.counts) << added.type;
  EXPECT_GT(whole.counts.back(), 0) << added.type << " did not act: the test proves nothing";
}

class GrownFaultTest : public ::testing::TestWithParam<FaultType> {};

TEST_P(GrownFaultTest, ActsAsIfItHadBeenThere) {
  FaultSpec added = ExampleSpec(GetParam());
  added.end_ns = kNever;
  if (GetParam().end == Bound::kRequired) added.end_ns = 1000 * kPeriod;
  ExpectSameAsFromTheBeginning(added);
}

std::vector<FaultType> NoCommands() {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (!type.is_command()) types.push_back(type);
  return types;
}

// Among others, some of which act before it on the same data, and some after it.
TEST_P(GrownFaultTest, ActsAsIfItHadNotBeenOpen) {
  if (!GetParam().IsOneOf<WireKind, SensorKind, ActuatorKind, PlantKind>()) return;
  FaultSpec given = ExampleSpec(GetParam());
  given.id = "given";
  given.start_ns = kAdded * kPeriod;
  given.end_ns = 1000 * kPeriod;
  std::vector<FaultSpec> all = Others();
  all.insert(all.begin() + 2, given);
  for (FaultSpec& other : Others()) all.push_back(other), all.back().id += "-too";
  const FaultSchedule::Place place{.protocol = ProtocolFor(all), .signals = TiltrotorSignals()};
  FaultSchedule::Place open = place;
  open.use.open = 2;
  const FlownInTurn whole = FlyInTurn(FaultSchedule(all, 7, place), nullptr);
  // The open fault ends at another time.
  all[2].end_ns = 1001 * kPeriod;
  const FlownInTurn departed = FlyInTurn(FaultSchedule(all, 7, open), nullptr, &given);
  EXPECT_TRUE(SameOutcome(whole, departed));
  EXPECT_EQ(whole.counts, departed.counts);
  EXPECT_GT(whole.counts[2], 0) << "it did not act: the test proves nothing";
}

TEST(OpenFaultTest, MustBeGivenBeforeItActs) {
  const std::vector<FaultSpec> all = {At(Spec("frame.drop", {{"probability", 1.0}}), kAdded * kPeriod)};
  FaultSchedule::Place open{.protocol = ProtocolFor(all), .signals = TiltrotorSignals()};
  open.use.open = 0;
  EXPECT_THROW(FlyInTurn(FaultSchedule(all, 7, open), nullptr), OpenFaultActs);
}

INSTANTIATE_TEST_SUITE_P(All, GrownFaultTest, ::testing::ValuesIn(NoCommands()), TestName);

// The longest memories that faults can have.
TEST(GrownFaultMemoryTest, RemembersAsFarBackAsAnyModelLooks) {
  ExpectSameAsFromTheBeginning(
      Spec("sensor.delay", {{"signal", std::string("z_m")}, {"delay_ms", 10'000.0}}));
  ExpectSameAsFromTheBeginning(
      Spec("actuator.delay", {{"actuator", std::string("f_r")}, {"delay_ms", 10'000.0}}));
  ExpectSameAsFromTheBeginning(Spec("frame.replay_stale", {{"probability", 1.0}, {"age_count", 850.0}}));
}

}  // namespace
}  // namespace tiltproof::faults
