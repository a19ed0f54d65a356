// Every fault on sensors and on actuators acts when its window, period, condition or the fault that it follows
// says, and at no other time.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/faults/faulty_flight.h"

namespace tiltproof::faults {
namespace {

struct Timing {
  std::string name;
  std::function<void(FaultSpec&)> set;
  std::vector<News> news;                       // heard at their times, of fault 0
  std::function<bool(std::int64_t)> is_active;  // at sample or step n, at n * 12 ms
};

const std::vector<Timing>& Timings() {
  static const std::vector<Timing> timings = {
      {"window",
       [](FaultSpec& spec) {
         spec.start_ns = 100 * kPeriod;
         spec.end_ns = 700 * kPeriod;
       },
       {},
       [](std::int64_t n) { return n >= 100 && n < 700; }},
      {"periods",
       [](FaultSpec& spec) {
         spec.start_ns = 100 * kPeriod;
         spec.end_ns = 700 * kPeriod;
         spec.period_ns = 50 * kPeriod;
         spec.duty = 0.5;
       },
       {},
       [](std::int64_t n) { return n >= 100 && n < 700 && n % 50 < 25; }},
      {"level",
       [](FaultSpec& spec) { spec.when = "z_m > 3"; },
       {{News::Kind::kConditionHolds, 0, 200 * kPeriod},
        {News::Kind::kConditionEnds, 0, 300 * kPeriod},
        {News::Kind::kConditionHolds, 0, 500 * kPeriod},
        {News::Kind::kConditionEnds, 0, 560 * kPeriod}},
       [](std::int64_t n) { return (n >= 200 && n < 300) || (n >= 500 && n < 560); }},
      {"edge",
       [](FaultSpec& spec) {
         spec.when = "z_m > 3";
         spec.edge = Edge::kRising;
         spec.end_ns = 600 * kPeriod;
       },
       {{News::Kind::kConditionHolds, 0, 200 * kPeriod}, {News::Kind::kConditionEnds, 0, 300 * kPeriod}},
       [](std::int64_t n) { return n >= 200 && n < 600; }},
      {"after",
       [](FaultSpec& spec) {
         spec.after = After{"other", 10 * kPeriod};
         spec.period_ns = 40 * kPeriod;
         spec.duty = 0.5;
       },
       {{News::Kind::kFirstActivation, 1, 150 * kPeriod}},
       [](std::int64_t n) { return n >= 160 && (n - 160) % 40 < 20; }},
  };
  return timings;
}

std::vector<FaultType> TypesOfTheVehicle() {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (type.layer() == "sensor" || type.layer() == "actuator") types.push_back(type);
  return types;
}

// In which of the samples and steps of a flight the fault changed something.
std::vector<bool> Changed(const FaultSpec& spec, std::vector<News> news) {
  // The other never acts by itself: a frame on no line.
  FaultSchedule schedule = AtThePlant({spec, Spec("frame.drop", {{"probability", 1.0}}, "other")});
  std::vector<bool> changed;
  for (std::int64_t n = 0; n < kFrames; ++n) {
    const TimeNs t = n * kPeriod;
    while (!news.empty() && news.front().time_ns <= t) {
      schedule.Hear(std::vector<News>{news.front()});
      news.erase(news.begin());
    }
    const std::int64_t before = schedule.ActivationCounts().at(0);
    Sensors sensors = Sample(n);
    EditSensors(schedule, t, sensors);
    ActuatorsTruth input = Command(n);
    EditActuators(schedule, t, input);
    changed.push_back(sensors != Sample(n) || input != Command(n));
    EXPECT_EQ(changed.back(), schedule.ActivationCounts().at(0) > before) << n;
  }
  return changed;
}

class VehicleTimingTest : public ::testing::TestWithParam<FaultType> {};

TEST_P(VehicleTimingTest, ActsInItsTimeAlone) {
  for (const Timing& timing : Timings()) {
    FaultSpec spec = ExampleSpec(GetParam());
    timing.set(spec);
    const std::vector<bool> changed = Changed(spec, timing.news);
    int inside = 0;
    for (std::int64_t n = 0; n < kFrames; ++n) {
      if (!changed[static_cast<std::size_t>(n)]) continue;
      ++inside;
      ASSERT_TRUE(timing.is_active(n)) << timing.name << " " << n;
    }
    EXPECT_GT(inside, 0) << timing.name;
  }
}

INSTANTIATE_TEST_SUITE_P(All, VehicleTimingTest, ::testing::ValuesIn(TypesOfTheVehicle()), TestName);

}  // namespace
}  // namespace tiltproof::faults
