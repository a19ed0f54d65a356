// Rules that every fault type must keep, whatever it does. The tests run over the whole registry.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "faults/device_command.h"
#include "faults/node_command.h"
#include "faults/registry.h"
#include "faults/schedule.h"
#include "faults/signal_choice.h"
#include "tests/faults/faulty_flight.h"
#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {

namespace {

using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// The chunks that came of frame n, wherever they came out.
std::vector<link::Chunk> Descendants(const Outcome& outcome, std::int64_t n) {
  std::vector<link::Chunk> all;
  for (const auto& out : outcome.frames) {
    for (const auto& chunk : out) {
      if (chunk.number == static_cast<std::uint64_t>(n)) all.push_back(chunk);
    }
  }
  return all;
}

class RegistryConformanceTest : public ::testing::TestWithParam<FaultType> {
 protected:
  const FaultType& type() const { return GetParam(); }
};

// Types that edit what passes; of these the ones with a value that changes nothing, and the ones that stand in
// the line. The rest are commands to nodes (node_command_test.cpp), commands to the device
// (device_command_test.cpp), and marks on received bytes (receiver_test.cpp).
class EditConformanceTest : public RegistryConformanceTest {};
class ZeroConformanceTest : public RegistryConformanceTest {};
class SeverityConformanceTest : public RegistryConformanceTest {};
class WireConformanceTest : public RegistryConformanceTest {};

bool Edits(const FaultType& type) { return type.IsOneOf<WireKind, SensorKind, ActuatorKind, PlantKind>(); }

bool HasZero(const FaultType& type) {
  return Edits(type) && std::any_of(type.parameters.begin(), type.parameters.end(),
                                    [](const ParameterInfo& info) { return info.zero.has_value(); });
}

bool AlwaysCounts(const FaultType& type) {
  const auto* sensor = type.As<SensorKind>();
  return sensor != nullptr && sensor->always_counts;
}
bool Remembers(const FaultType& type) {
  const auto* wire = type.As<WireKind>();
  return wire != nullptr && wire->remembers;
}
bool SendsBack(const FaultType& type) {
  const auto* wire = type.As<WireKind>();
  return wire != nullptr && wire->sends_back;
}
bool HasSeverity(const FaultType& type) {
  return Edits(type) && std::any_of(type.parameters.begin(), type.parameters.end(),
                                    [](const ParameterInfo& info) { return info.severity.has_value(); });
}

bool OnWire(const FaultType& type) { return type.IsOneOf<WireKind>(); }

std::vector<FaultType> TypesThat(bool (*predicate)(const FaultType&)) {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes()) {
    if (predicate(type)) types.push_back(type);
  }
  return types;
}

TEST_P(RegistryConformanceTest, IsDocumented) {
  EXPECT_THAT(std::string(type().name), ::testing::MatchesRegex("[a-z]+\\.[a-z_]+"));
  EXPECT_THAT((std::set<std::string_view>{"wire", "frame", "link", "sensor", "actuator", "plant", "node",
                                          "dds", "clock", "device", "uart", "harness"}),
              Contains(type().layer()));
  EXPECT_TRUE(type().summary.ends_with('.'));
  EXPECT_TRUE(type().semantics.ends_with('.'));
  EXPECT_THAT(std::string(type().semantics), HasSubstr("Models "));  // what it is in the real world
  const std::string catalogue = CatalogueMarkdown();
  EXPECT_THAT(catalogue, HasSubstr("## " + std::string(type().name) + "\n"));
  EXPECT_TRUE(type().source.ends_with('.'));
  const std::string entry = Markdown(type());
  EXPECT_THAT(entry, HasSubstr("\nSource: "));
  const ParameterInfo* severity = type().severity_parameter();
  EXPECT_THAT(entry, HasSubstr(!type().has_severity() ? "\nSeverity: none: "
                               : severity == nullptr  ? "\nSeverity: the length of the window, from 0 s"
                               : type().duration_ms.empty()
                                   ? "\nSeverity: `" + std::string(severity->name) + "`, from "
                                   : "\nSeverity: the length of the window, `" + std::string(severity->name) +
                                         "`, from "));
  std::set<std::string_view> names;
  for (const ParameterInfo& info : type().parameters) {
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_FALSE(info.doc.empty()) << info.name;
    EXPECT_EQ(info.unit.empty(), info.kind == ParameterKind::kChoice || info.kind == ParameterKind::kText ||
                                     info.kind == ParameterKind::kField ||
                                     info.kind == ParameterKind::kFrameWords || NamesSignal(info.kind) ||
                                     NamesPart(info.kind))
        << info.name;
    EXPECT_EQ(info.choices.empty(), info.kind != ParameterKind::kChoice) << info.name;
    EXPECT_THAT(catalogue, HasSubstr("| `" + std::string(info.name) + "` |"));
  }
  // Who edits the wire, sensors or actuators is the harness itself.
  EXPECT_EQ(type().needs == Needs::kNothing, Edits(type()));
  EXPECT_EQ(type().needs == Needs::kNodes, type().IsOneOf<NodeKind>());
}

TEST_P(RegistryConformanceTest, ItsExampleIsValid) { EXPECT_THAT(Validate(ExampleSpec(type())), IsEmpty()); }

TEST_P(EditConformanceTest, ItsExampleActs) { EXPECT_GT(Fly({ExampleSpec(type())}).counts.at(0), 0); }

TEST_P(EditConformanceTest, IsNoCommand) {
  EXPECT_THAT(NodeCommands({ExampleSpec(type())}), IsEmpty());
  EXPECT_THAT(DeviceCommands({ExampleSpec(type())}, 1), IsEmpty());
}

TEST_P(RegistryConformanceTest, KeepsToTheWindowItDeclares) {
  const auto complains = [&](const std::string& key, const FaultSpec& spec) {
    const std::vector<Problem> problems = Validate(spec);
    return std::any_of(problems.begin(), problems.end(), [&](const Problem& p) { return p.key == key; });
  };
  FaultSpec without = ExampleSpec(type());
  without.start_ns = kPowerOn;
  without.end_ns = kNever;
  EXPECT_EQ(complains("start_s", without), type().start == Bound::kRequired);
  EXPECT_EQ(complains("end_s", without), type().end == Bound::kRequired);
  FaultSpec with = ExampleSpec(type());
  with.start_ns = 0;
  with.end_ns = kNsPerS;
  EXPECT_EQ(complains("start_s", with), type().start == Bound::kRefused);
  EXPECT_EQ(complains("end_s", with), type().end == Bound::kRefused);
}

TEST_P(RegistryConformanceTest, RefusesWrongParameters) {
  FaultSpec spec = ExampleSpec(type());
  spec.parameters["gremlins"] = 1.0;
  EXPECT_THAT(Validate(spec), Contains(Field(&Problem::key, "parameters.gremlins")));

  for (const ParameterInfo& info : type().parameters) {
    const std::string name(info.name);
    const std::string key = "parameters." + name;
    const auto problems_with = [&](const ParameterValue& value) {
      FaultSpec changed = ExampleSpec(type());
      changed.parameters[name] = value;
      return Validate(changed);
    };

    spec = ExampleSpec(type());
    spec.parameters.erase(name);
    if (info.default_value) {
      EXPECT_THAT(Validate(spec), IsEmpty()) << name;
      EXPECT_THAT(problems_with(*info.default_value), IsEmpty()) << name;
    } else {
      EXPECT_THAT(Validate(spec), Contains(Field(&Problem::message, HasSubstr("'" + name + "'")))) << name;
    }
    if (info.zero) {
      EXPECT_THAT(problems_with(*info.zero), IsEmpty()) << name;
    }

    const auto refused = Contains(Field(&Problem::key, key));
    if (NamesPart(info.kind)) {
      FaultSpec named = ExampleSpec(type());
      named.parameters[name] = "gremlin";
      EXPECT_THROW(AtThePlant({named}), std::invalid_argument);
      for (const std::string& known : SignalNames(TiltrotorSignals(), info.kind)) {
        named.parameters[name] = known;
        EXPECT_NO_THROW(AtThePlant({named})) << known;
      }
    }
    if (info.kind == ParameterKind::kText || info.kind == ParameterKind::kField || NamesPart(info.kind)) {
      EXPECT_THAT(problems_with(1.0), refused);
      for (const std::string text : {"", " a", "a ", "a\tb", "\x7F", "r\xC3\xA4m"})
        EXPECT_THAT(problems_with(text), refused) << text;
      for (const std::string text : {"a", "a b", "Controller::gain_[4]"})
        EXPECT_THAT(problems_with(text), IsEmpty()) << text;
      EXPECT_THAT(problems_with(std::string(kParameterTextMax, 'x')), IsEmpty());
      EXPECT_THAT(problems_with(std::string(kParameterTextMax + 1, 'x')), refused);
      continue;
    }
    if (NamesSignal(info.kind)) {
      EXPECT_THAT(problems_with(1.0), refused);
      for (const std::string text : {"", "z m", "1_m", "_m", "h\xC3\xB6he_m", "z_m\n"})
        EXPECT_THAT(problems_with(text), refused) << text;
      // Only the vehicle knows its signals. The schedule has them, and refuses others.
      EXPECT_THAT(problems_with("gremlin_m"), IsEmpty());
      FaultSpec named = ExampleSpec(type());
      named.parameters[name] = "gremlin_m";
      EXPECT_THROW(AtThePlant({named}), std::invalid_argument);
      for (const std::string& known : SignalNames(TiltrotorSignals(), info.kind)) {
        named.parameters[name] = known;
        EXPECT_NO_THROW(AtThePlant({named})) << known;
      }
      continue;
    }
    if (info.kind == ParameterKind::kFrameWords) continue;  // models/frame/script_test.cpp
    if (info.kind == ParameterKind::kVector) {
      using Vector = std::array<double, 3>;
      EXPECT_THAT(problems_with(1.0), refused);
      EXPECT_THAT(problems_with(Vector{}), refused);
      EXPECT_THAT(problems_with(Vector{0, 0, std::nextafter(info.max, 1e300)}), refused);
      EXPECT_THAT(problems_with(Vector{0, std::numeric_limits<double>::quiet_NaN(), 1}), refused);
      EXPECT_THAT(problems_with(Vector{info.min, info.max, 0}), IsEmpty());
      continue;
    }
    EXPECT_THAT(problems_with("no such choice"), refused);
    if (info.kind == ParameterKind::kChoice) {
      EXPECT_THAT(problems_with(1.0), refused);
      for (const std::string_view choice : info.choices) {
        EXPECT_THAT(problems_with(std::string(choice)), IsEmpty()) << choice;
      }
      continue;
    }
    EXPECT_LT(info.min, info.max);
    EXPECT_THAT(problems_with(info.min), IsEmpty()) << name;
    EXPECT_THAT(problems_with(info.max), IsEmpty()) << name;
    EXPECT_THAT(problems_with(std::nextafter(info.min, -1e300)), refused);
    EXPECT_THAT(problems_with(std::nextafter(info.max, 1e300)), refused);
    EXPECT_THAT(problems_with(std::numeric_limits<double>::quiet_NaN()), refused);
    EXPECT_THAT(problems_with(std::numeric_limits<double>::infinity()), refused);
    if (info.kind == ParameterKind::kInteger) {
      EXPECT_THAT(problems_with(info.min + 0.5), refused);
    }
  }
}

TEST_P(RegistryConformanceTest, RefusesWrongTargets) {
  for (const Target target :
       {Target::kNone, Target::kToClient, Target::kToPlant, Target::kBoth, Target::kReference}) {
    FaultSpec spec = ExampleSpec(type());
    spec.target = target;
    const bool is_line = target == Target::kToClient || target == Target::kReference ||
                         (target != Target::kNone && type().IsOneOf<WireKind>());
    const bool has_way_back = target != Target::kReference || !SendsBack(type());
    const bool allowed = target == Target::kNone ? !type().has_target() || type().default_target()
                                                 : is_line && type().has_target() && has_way_back;
    if (allowed) {
      EXPECT_THAT(Validate(spec), IsEmpty()) << Name(target);
      EXPECT_NO_THROW(AtTheLine({spec}, 1));
    } else {
      EXPECT_THAT(Validate(spec), Contains(Field(&Problem::key, "target"))) << Name(target);
      EXPECT_THROW(AtTheLine({spec}, 1), std::invalid_argument);
    }
  }
}

TEST_P(EditConformanceTest, SameSeedSameOutcome) {
  FaultSpec spec = ExampleSpec(type());
  spec.probability = 0.7;
  const Outcome first = Fly({spec}, 5);
  const Outcome second = Fly({spec}, 5);
  EXPECT_TRUE(SameOutcome(first, second));
  EXPECT_EQ(first.counts, second.counts);
  // With the trigger's probability another seed has another outcome, for every type that changes anything.
  if (!AlwaysCounts(type())) {
    EXPECT_FALSE(SameOutcome(first, Fly({spec}, 6)));
  }
}

TEST_P(ZeroConformanceTest, ZeroIntensityChangesNothing) {
  FaultSpec spec = ExampleSpec(type());
  for (const ParameterInfo& info : type().parameters) {
    if (info.zero) spec.parameters[std::string(info.name)] = *info.zero;
  }
  const Outcome outcome = Fly({spec});
  EXPECT_TRUE(SameOutcome(outcome, Fly({})));
  EXPECT_EQ(outcome.counts.at(0), 0);
  EXPECT_THAT(outcome.activations, IsEmpty());
}

TEST_P(RegistryConformanceTest, HasOneSeverityAtMostAndItsHarmlessValueIsAnEndOfItsRange) {
  int count = 0;
  for (const ParameterInfo& info : type().parameters) {
    if (!info.severity) continue;
    ++count;
    ASSERT_TRUE(info.zero) << info.name;
    const double harmless = std::get<double>(*info.zero);
    EXPECT_TRUE(harmless == info.min || harmless == info.max || (harmless == 0 && info.min == -info.max) ||
                (harmless == 1 && info.min * info.max == 1))
        << info.name;
  }
  EXPECT_LE(count, 1);
}

// All else is as in the example, optional parameters at their defaults: the harmless value must be enough.
TEST_P(SeverityConformanceTest, AtItsHarmlessValueNothingChanges) {
  FaultSpec spec = ExampleSpec(type());
  for (const ParameterInfo& info : type().parameters) {
    if (info.default_value) spec.parameters[std::string(info.name)] = *info.default_value;
    if (info.severity) spec.parameters[std::string(info.name)] = *info.zero;
  }
  EXPECT_TRUE(SameOutcome(Fly({spec}), Fly({})));
}

TEST_P(EditConformanceTest, ActsOnlyInItsWindow) {
  FaultSpec spec = ExampleSpec(type());
  // Borders between the grid points and on them.
  spec.start_ns = 300 * kPeriod;
  spec.end_ns = 600 * kPeriod + 1;
  const Outcome outcome = Fly({spec});
  EXPECT_GT(outcome.counts.at(0), 0);
  for (std::int64_t n = 0; n < kFrames; ++n) {
    if (n >= 300 && n <= 600) continue;
    const auto index = static_cast<std::size_t>(n);
    ASSERT_TRUE(Unchanged(Descendants(outcome, n), n)) << n;
    ASSERT_EQ(outcome.sensors[index], Sample(n)) << n;
    ASSERT_EQ(outcome.actuators[index], Command(n)) << n;
    ASSERT_EQ(outcome.disturbances[index], Disturbance{}) << n;
  }
  for (const Activation& activation : outcome.activations) {
    EXPECT_GE(activation.time_ns, spec.start_ns);
    EXPECT_LT(activation.time_ns, spec.end_ns);
  }
}

TEST_P(WireConformanceTest, WaitsForTheOriginUnlessOpenFromPowerOn) {
  const auto activations = [&](TimeNs start_ns) {
    FaultSpec spec = ExampleSpec(type());
    spec.start_ns = start_ns;
    FaultSchedule schedule = AtTheLine({spec}, 1);
    for (std::int64_t n = 0; n < kFrames; ++n) {
      std::vector<link::Chunk> chunks = {Frame(n)};
      schedule.Filter(link::Direction::kToClient)->Apply(chunks);
    }
    return schedule.ActivationCounts().at(0);
  };
  EXPECT_EQ(activations(-kNsPerS), 0);
  EXPECT_GT(activations(kPowerOn), 0);
}

TEST_P(WireConformanceTest, WindowsAreInSimulationTimeAndRecordsToo) {
  FaultSpec spec = ExampleSpec(type());
  spec.start_ns = 300 * kPeriod;
  spec.end_ns = 600 * kPeriod;
  FaultSchedule schedule = AtTheLine({spec}, 1);
  constexpr Origin kOrigin(BootTime{100 * kPeriod});
  schedule.SetOrigin(kOrigin);
  for (std::int64_t n = 0; n < kFrames; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
    if (n < 400 || n >= 700) {
      ASSERT_TRUE(Remembers(type()) || Unchanged(chunks, n)) << n;
    }
  }
  EXPECT_GT(schedule.ActivationCounts().at(0), 0);
  for (const Activation& activation : schedule.TakeActivations(kOrigin)) {
    EXPECT_GE(activation.time_ns, spec.start_ns);
    EXPECT_LT(activation.time_ns, spec.end_ns);
    EXPECT_EQ(activation.time_ns, activation.before.at(0).begin_ns);
  }
}

// A frame counts as acted on when what it became at once is not just itself.
TEST_P(EditConformanceTest, RecordsWhatChangedAndNothingElse) {
  FaultSpec spec = ExampleSpec(type());
  spec.probability = 0.6;
  spec.every_nth_count = 2;
  const Outcome outcome = Fly({spec});
  ASSERT_THAT(outcome.activations, SizeIs(static_cast<std::size_t>(outcome.counts.at(0))));
  std::size_t record = 0;
  for (std::int64_t n = 0; n < kFrames; ++n) {
    const auto index = static_cast<std::size_t>(n);
    std::vector<link::Chunk> now;
    for (const auto& chunk : outcome.frames[index]) {
      if (chunk.number == static_cast<std::uint64_t>(n)) now.push_back(chunk);
    }
    // A disturbance lasts: it is recorded when it begins.
    const bool disturbed = outcome.disturbances[index] != Disturbance{} &&
                           (index == 0 || outcome.disturbances[index - 1] == Disturbance{});
    const bool changed = !Unchanged(now, n) || outcome.sensors[index] != Sample(n) ||
                         outcome.actuators[index] != Command(n) || disturbed;
    const bool recorded =
        record < outcome.activations.size() && outcome.activations[record].time_ns == n * kPeriod;
    if (!AlwaysCounts(type())) {
      ASSERT_EQ(recorded, changed) << n;
    }
    if (!recorded) continue;
    if (SendsBack(type())) now.pop_back();  // the record has what goes on
    const Activation& activation = outcome.activations[record++];
    EXPECT_EQ(activation.fault, 0U);
    EXPECT_FALSE(activation.what.empty());
    if (OnWire(type())) {
      EXPECT_TRUE(Same(activation.before, InLog({Frame(n)})));
      EXPECT_TRUE(Same(activation.after, InLog(now)));
    }
  }
  EXPECT_EQ(record, outcome.activations.size());
}

TEST_P(EditConformanceTest, AnotherFaultDoesNotShiftItsDraws) {
  FaultSpec spec = ExampleSpec(type());
  spec.probability = 0.6;
  // Removes every second frame before this one sees it; what acts on the frame's content or on its place
  // among the others then meets another line, so such types get a neighbour that leaves frames alone.
  FaultSpec other = Spec("frame.drop", {{"probability", 0.5}}, "other");
  const bool has_memory = Remembers(type()) || type().name == "wire.gilbert_elliott";
  if (has_memory) other = Spec("frame.delay", {{"mean_ms", 0.0}}, "other");
  FaultSpec more = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 0.0}}, "more");

  const Outcome alone = Fly({spec});
  const Outcome with_others = Fly({other, more, spec});
  int compared = 0;
  for (std::int64_t n = 0; n < kFrames; ++n) {
    const auto index = static_cast<std::size_t>(n);
    ASSERT_TRUE(SameBits(alone.sensors[index], with_others.sensors[index])) << n;
    ASSERT_EQ(alone.actuators[index], with_others.actuators[index]);
    const auto expected = Descendants(alone, n);
    const auto actual = Descendants(with_others, n);
    if (actual.empty() && !has_memory) continue;  // dropped before, or by this one too
    ASSERT_TRUE(Same(expected, actual)) << n;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST_P(WireConformanceTest, DirectionsAreIndependent) {
  FaultSpec spec = ExampleSpec(type());
  spec.target = Target::kBoth;
  spec.probability = 0.6;
  FaultSchedule both = AtTheLine({spec}, 1);
  const auto to_client = Send(both, kFrames);
  const auto to_plant = Send(both, kFrames, 68, link::Direction::kToPlant);
  EXPECT_EQ(both.Filter(link::Direction::kReference), nullptr);
  bool equal = true;
  for (std::size_t n = 0; n < to_client.size(); ++n) equal = equal && Same(to_client[n], to_plant[n]);
  EXPECT_FALSE(equal);

  spec.target = Target::kToClient;
  FaultSchedule one = AtTheLine({spec}, 1);
  const auto alone = Send(one, kFrames);
  for (std::size_t n = 0; n < alone.size(); ++n) ASSERT_TRUE(Same(alone[n], to_client[n])) << n;
}

TEST_P(WireConformanceTest, NothingTravelsBackInTime) {
  const Outcome outcome = Fly({ExampleSpec(type())});
  std::set<std::uint64_t> numbers;
  for (const auto& out : outcome.frames) {
    for (const auto& chunk : out) {
      EXPECT_FALSE(chunk.bytes.empty());
      EXPECT_GE(chunk.begin_ns, Frame(static_cast<std::int64_t>(chunk.number)).begin_ns);
      EXPECT_LT(chunk.number, static_cast<std::uint64_t>(kFrames));
    }
  }
}

TEST_P(WireConformanceTest, ActsOnAnIdealLineToo) {
  FaultSchedule schedule = AtTheLine({ExampleSpec(type())}, 1, {.baud = 0, .reference_baud = 0});
  Send(schedule, kFrames);
  EXPECT_GT(schedule.ActivationCounts().at(0), 0);
}

TEST_P(WireConformanceTest, SurvivesTheShortestAndTheLongestChunks) {
  for (const std::size_t size : {1U, 2U, 1024U}) {
    FaultSchedule schedule = AtTheLine({ExampleSpec(type())}, 1);
    for (const auto& out : Send(schedule, 200, size)) {
      for (const auto& chunk : out) ASSERT_FALSE(chunk.bytes.empty());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, RegistryConformanceTest, ::testing::ValuesIn(FaultTypes()), TestName);
INSTANTIATE_TEST_SUITE_P(All, EditConformanceTest, ::testing::ValuesIn(TypesThat(Edits)), TestName);
INSTANTIATE_TEST_SUITE_P(All, ZeroConformanceTest, ::testing::ValuesIn(TypesThat(HasZero)), TestName);
INSTANTIATE_TEST_SUITE_P(All, SeverityConformanceTest, ::testing::ValuesIn(TypesThat(HasSeverity)), TestName);
INSTANTIATE_TEST_SUITE_P(All, WireConformanceTest, ::testing::ValuesIn(TypesThat(OnWire)), TestName);

TEST(RegistryTest, NamesAreUniqueAndFound) {
  std::set<std::string_view> names;
  for (const FaultType& type : FaultTypes()) {
    EXPECT_TRUE(names.insert(type.name).second) << type.name;
    EXPECT_EQ(FindFaultType(type.name), &type);
  }
  EXPECT_EQ(FindFaultType("wire.gremlins"), nullptr);
}

}  // namespace

}  // namespace tiltproof::faults
