// WriteResolved(): what it writes reads back to an equal scenario, whatever the scenario.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/scenario/keys.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

// Gives every described key a random value within its bounds.
class RandomFiller : public KeyVisitor {
 public:
  void Bool(const Key&, bool& value) override { value = *rc::gen::arbitrary<bool>(); }
  void Number(const Key&, double& value, Range range) override { value = AnyNumber(range); }
  void MaybeNumber(const Key&, std::optional<double>& value, Range range) override {
    value = AnyNumber(range);
  }
  void NumberOr(const Key&, std::string_view, std::optional<double>& value, Range range) override {
    value.reset();
    if (*rc::gen::arbitrary<bool>()) value = AnyNumber(range);
  }
  void Integer(const Key&, std::int64_t& value, Range range) override {
    value = *rc::gen::inRange(static_cast<std::int64_t>(range.min), static_cast<std::int64_t>(range.max) + 1);
  }
  void Seconds(const Key&, TimeNs& value_ns, Range range_s) override {
    value_ns = *rc::gen::inRange(FromSeconds(range_s.min), FromSeconds(range_s.max));
  }
  void Text(const Key&, std::string& value, const TextRule& rule) override { value = AnyText(rule); }
  void Texts(const Key&, std::vector<std::string>& value, const TextRule& rule) override {
    value.resize(*rc::gen::inRange<std::size_t>(0, 4));
    for (auto& text : value) text = AnyText(rule);
  }
  void Point(const Key&, std::array<double, 3>& value, Range range) override {
    for (double& number : value) number = AnyNumber(range);
  }
  void Points(const Key& key, std::vector<std::array<double, 3>>& value, Range range) override {
    value.resize(*rc::gen::inRange<std::size_t>(1, 5));
    for (auto& point : value) Point(key, point, range);
  }
  void Choice(const Key&, std::span<const std::string_view> words,
              std::optional<std::size_t>& index) override {
    index = *rc::gen::inRange<std::size_t>(0, words.size());
  }
  void WordOrName(const Key&, std::span<const std::string_view> words, std::string& text,
                  const TextRule&) override {
    text = words[*rc::gen::inRange<std::size_t>(0, words.size())];
  }
  void Bytes(const Key&, std::vector<std::uint8_t>&, std::size_t) override {}
  void NameOrSection(const Key&, std::span<const std::string_view> names, std::string& name,
                     const Body&) override {
    name = names[*rc::gen::inRange<std::size_t>(0, names.size())];
  }
  void ChoiceByName(const Key&, std::span<const std::string_view> words, NamedChoices& value,
                    const TextRule& name_rule) override {
    value.by_name.resize(*rc::gen::inRange<std::size_t>(0, 3));
    if (value.by_name.empty()) value.all = *rc::gen::inRange<std::size_t>(0, words.size());
    for (std::size_t i = 0; i < value.by_name.size(); ++i)
      value.by_name[i] = {AnyText(name_rule) + std::to_string(i),
                          *rc::gen::inRange<std::size_t>(0, words.size())};
  }
  void Section(const Key&, const Body& body) override { body(*this); }
  void MaybeSection(const Key&, bool, const Body& body) override {
    if (*rc::gen::arbitrary<bool>()) body(*this);
  }
  void WordOrSection(const Key&, std::string_view, bool, const Body& body) override {
    if (*rc::gen::arbitrary<bool>()) body(*this);
  }
  void List(const Key&, std::size_t, const std::function<void(std::size_t)>& resize,
            const NumberedBody& body) override {
    const auto count = *rc::gen::inRange<std::size_t>(0, 4);
    resize(count);
    for (std::size_t i = 0; i < count; ++i) body(*this, i);
  }
  void Alternatives(const Key&, std::span<const Alternative> alternatives, std::optional<std::size_t>,
                    const NumberedBody& body) override {
    body(*this, *rc::gen::inRange<std::size_t>(0, alternatives.size()));
  }

 private:
  static double AnyNumber(Range range) {
    const double part = static_cast<double>(*rc::gen::arbitrary<std::uint32_t>()) / 4294967295.0;
    const double between = std::clamp(range.min + part * (range.max - range.min), range.min, range.max);
    // Round numbers and tiny ones too.
    const double round = std::clamp(std::round(between), range.min, range.max);
    const double tiny = std::clamp(between * 1e-9, range.min, range.max);
    return *rc::gen::element(between, round, tiny, range.min, range.max);
  }
  static std::string AnyText(const TextRule& rule) {
    const bool free = rule.regex.empty();
    const std::vector<std::string> pieces =
        free ? std::vector<std::string>{"a", "Z", "0", " ", ":", "#", "\"", "'", "\\", "\n", "\t", "-", "{",
                                        "}", "[", "]", "&", "*", "!", "%",  "@", "é",  "€",  "𝄞",  "no"}
             : std::vector<std::string>{"a", "b", "0", "1", "_"};
    std::string text = "x";
    const auto count = *rc::gen::inRange(0, 12);
    for (int i = 0; i < count; ++i) text += *rc::gen::elementOf(pieces);
    return text;
  }
};

// Random as far as the keys by themselves go; this makes them agree with each other and with the world.
void MakeConsistent(Scenario& s, const fs::path& folder) {
  s.initial_on_ground = s.initial_on_ground && s.solid_ground;
  if (s.initial_on_ground) s.initial_position_m[2] = 0;
  s.duration_ns = std::max(s.duration_ns, s.link.protocol->control_period_ns);
  s.step_ns =
      *rc::gen::elementOf(std::vector<TimeNs>{kNsPerMs, 3 * kNsPerMs, 4 * kNsPerMs, 12 * kNsPerMs, 10'000});
  s.gain = *rc::gen::elementOf(std::vector<std::string>{"", "design", (folder / "own.sdf").string()});
  s.gain_file = s.gain.starts_with('/') ? fs::path(s.gain) : fs::path();
  s.model = *rc::gen::elementOf(
      std::vector<std::string>{"tiltrotor", "tiltrotor_published", (folder / "own.sdf").string()});
  s.model_file = s.model.ends_with(".sdf") ? fs::path(s.model) : folder / "models" / (s.model + ".sdf");
  if (auto* recorded = std::get_if<RecordedReference>(&s.reference.path))
    recorded->file = folder / "path.csv";
  for (std::size_t i = 0; i < s.clients.size(); ++i) s.clients[i].id = "c" + std::to_string(i);
  if (s.clients.size() < 2) s.lines.clear();
  for (std::size_t i = 0; i < s.lines.size(); ++i) {
    s.lines[i].id = "l" + std::to_string(i);
    s.lines[i].between = {s.clients.back().id, s.clients.front().id};
  }
  for (std::size_t i = 0; i < s.firmware_parameters.size(); ++i)
    s.firmware_parameters[i].name = "n" + std::to_string(i);
  const auto any_client = [&]() -> std::string {
    const auto place = *rc::gen::inRange<std::size_t>(0, s.clients.size() + 1);
    return place < s.clients.size() ? s.clients[place].id : "";
  };
  ArbiterSpec& arbiter = s.arbiter;
  if (s.clients.size() < 2) arbiter = {};
  if (arbiter.type == ArbiterType::kDuplexCompare && s.clients.size() > 2)
    arbiter = {.type = ArbiterType::kMidValue, .timeout_ms = arbiter.timeout_ms};
  if (arbiter.type == ArbiterType::kSingle) arbiter.client = any_client();
  if (arbiter.type == ArbiterType::kPrimaryBackup) {
    arbiter.order.clear();
    for (const ClientEntry& client : s.clients)
      if (arbiter.order.empty() || *rc::gen::arbitrary<bool>())
        arbiter.order.insert(arbiter.order.begin(), client.id);
  }
  if (arbiter.type == ArbiterType::kDuplexCompare)
    arbiter.on_disagreement = *rc::gen::elementOf(std::vector<std::string>{"hold", "hover", s.clients[1].id});
  for (std::size_t i = 0; i < s.faults.size(); ++i) {
    faults::FaultSpec& fault = s.faults[i];
    if (fault.type == "frame.length_error") {  // the frames of `paper` have no length
      fault.type = "link.silence";
      fault.parameters.clear();
    }
    if (fault.type == "frame.wrong_id")
      fault.parameters["id"] = static_cast<double>(*rc::gen::inRange(0, 256));
    if (!fault.client.empty()) fault.client = any_client();
    fault.id.append("-").append(std::to_string(i));
    if (*rc::gen::arbitrary<bool>()) fault.start_ns = kPowerOn;
    if (fault.start_ns >= s.duration_ns) fault.start_ns = s.duration_ns - 1;
    if (*rc::gen::arbitrary<bool>()) fault.end_ns = kNever;
    const faults::FaultType& type = *faults::FindFaultType(fault.type);
    if (type.start == faults::Bound::kRefused) fault.start_ns = kPowerOn;
    if (type.start == faults::Bound::kRequired && fault.start_ns == kPowerOn) fault.start_ns = 0;
    if (type.end == faults::Bound::kRefused || fault.end_ns <= fault.start_ns) fault.end_ns = kNever;
    if (type.end == faults::Bound::kRequired && fault.end_ns == kNever) fault.end_ns = fault.start_ns + 1;
    if (*rc::gen::arbitrary<bool>()) fault.when.clear();
    if (fault.when.empty()) fault.edge = faults::Edge::kLevel;
    if (i == 0) fault.after.reset();
    if (fault.after) fault.after->fault = s.faults[i - 1].id;
    if (*rc::gen::arbitrary<bool>()) fault.period_ns = kNever;
    if (fault.period_ns == kNever) fault.duty.reset();
    for (const auto& problem : faults::Validate(fault)) {
      if (problem.key == "message") fault.message.clear();
      if (problem.key == "parameters.frames") fault.parameters["frames"] = std::string("7e00 - 7d");
      if (problem.key == "parameters.direction") fault.parameters["direction"] = std::array{0.0, 0.0, 1.0};
      if (problem.key == "period_s") {
        fault.period_ns = kNever;
        fault.duty.reset();
      }
    }
  }
  for (faults::FaultSpec& fault : s.faults) {
    const faults::FaultType& type = *faults::FindFaultType(fault.type);
    if (!faults::MessageProblem(fault, type, *s.link.protocol).empty()) fault.message.clear();
    const auto fields = [&] {
      return faults::FieldNames(*s.link.protocol, faults::ResolvedTarget(fault, type), fault.message);
    };
    for (const faults::ParameterInfo& info : type.parameters) {
      if (info.kind != faults::ParameterKind::kField) continue;
      if (fields().empty()) fault.message.clear();  // it has none
      fault.parameters[std::string(info.name)] = *rc::gen::elementOf(fields());
    }
    // No integer is NaN.
    if (const auto problem = faults::ProtocolProblem(fault, *s.link.protocol);
        problem && problem->key == "parameters.kind")
      fault.parameters["kind"] = std::string("offset");
  }
  for (std::size_t i = 0; i < s.watch.size(); ++i) s.watch[i].append(".").append(std::to_string(i));
  for (std::size_t i = 0; i < s.criteria.size(); ++i) {
    CriterionSpec& criterion = s.criteria[i];
    criterion.name.append("-").append(std::to_string(i));
    if (*rc::gen::arbitrary<bool>()) {
      criterion.metric.clear();
      criterion.min.reset();
      criterion.max.reset();
    } else {
      criterion.stl.clear();
      criterion.metric = "tracking.rmse_m";
      if (*criterion.min > *criterion.max) std::swap(criterion.min, criterion.max);
      const int bounds = *rc::gen::inRange(0, 3);
      if (bounds == 0) criterion.min.reset();
      if (bounds == 1) criterion.max.reset();
    }
  }
}

void ExpectSame(const Scenario& a, const Scenario& b) {
  RC_ASSERT(a.format == b.format);
  RC_ASSERT(a.name == b.name);
  RC_ASSERT(a.description == b.description);
  RC_ASSERT(a.tags == b.tags);
  RC_ASSERT(a.model == b.model);
  RC_ASSERT(a.model_file == b.model_file);
  RC_ASSERT(a.firmware == b.firmware);
  RC_ASSERT(a.gain == b.gain);
  RC_ASSERT(a.gain_file == b.gain_file);
  RC_ASSERT(a.firmware_parameters == b.firmware_parameters);
  RC_ASSERT(a.clients == b.clients);
  RC_ASSERT(a.lines == b.lines);
  RC_ASSERT(a.arbiter == b.arbiter);
  RC_ASSERT(a.expect == b.expect);
  RC_ASSERT(a.allow_restarts == b.allow_restarts);
  RC_ASSERT(a.held == b.held);
  RC_ASSERT(a.control_period_tolerance_percent == b.control_period_tolerance_percent);
  RC_ASSERT(a.clean_line_periods_count == b.clean_line_periods_count);
  RC_ASSERT(a.start_within_ns == b.start_within_ns);
  RC_ASSERT(a.seed == b.seed);
  RC_ASSERT(a.duration_ns == b.duration_ns);
  RC_ASSERT(a.stop_ns == b.stop_ns);
  RC_ASSERT(a.step_ns == b.step_ns);
  RC_ASSERT(a.angular_rates == b.angular_rates);
  RC_ASSERT(a.allow_invalid_inertia == b.allow_invalid_inertia);
  RC_ASSERT(a.initial_position_m == b.initial_position_m);
  RC_ASSERT(a.initial_on_ground == b.initial_on_ground);
  RC_ASSERT(a.solid_ground == b.solid_ground);
  RC_ASSERT(a.initial_attitude_rad == b.initial_attitude_rad);
  RC_ASSERT(a.link == b.link);
  RC_ASSERT(a.reference == b.reference);
  RC_ASSERT(a.criteria == b.criteria);
  RC_ASSERT(a.watch == b.watch);
  RC_ASSERT(a.faults.size() == b.faults.size());
  for (std::size_t i = 0; i < a.faults.size(); ++i) {
    const faults::FaultSpec &x = a.faults[i], &y = b.faults[i];
    RC_ASSERT(x.id == y.id);
    RC_ASSERT(x.type == y.type);
    RC_ASSERT(x.target == y.target);
    RC_ASSERT(x.start_ns == y.start_ns);
    RC_ASSERT(x.end_ns == y.end_ns);
    RC_ASSERT(x.period_ns == y.period_ns);
    RC_ASSERT(x.duty == y.duty);
    RC_ASSERT(x.when == y.when);
    RC_ASSERT(x.edge == y.edge);
    RC_ASSERT(x.after == y.after);
    RC_ASSERT(x.every_nth_count == y.every_nth_count);
    RC_ASSERT(x.probability == y.probability);
    RC_ASSERT(x.message == y.message);
    RC_ASSERT(x.parameters == y.parameters);
  }
}

class ResolvedTest : public testing::Test {
 protected:
  ResolvedTest()
      : folder_(fs::path(testing::TempDir()) /
                (std::string("tiltproof_resolved_") +
                 testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_ / "models");
    for (const char* name : {"models/tiltrotor.sdf", "models/tiltrotor_published.sdf", "own.sdf"}) {
      std::ofstream(folder_ / name) << "<sdf/>";
    }
    std::ofstream(folder_ / "path.csv") << "t_s,x_m,y_m,z_m,yaw_rad\n0,1,2,3,0\n";
    options_.models_folder = folder_ / "models";
  }
  Scenario ReadBack(const std::string& yaml) {
    const fs::path file = folder_ / "scenario.resolved.yaml";
    std::ofstream(file, std::ios::binary) << yaml;
    return ReadScenario(file, options_);
  }

  fs::path folder_;
  ReadOptions options_;
};

RC_GTEST_FIXTURE_PROP(ResolvedTest, ReadsBackToAnEqualScenario, ()) {
  Scenario scenario;
  RandomFiller filler;
  DescribeScenario(filler, scenario);
  MakeConsistent(scenario, folder_);
  if (scenario.link.adapter) scenario.link.adapter_latency_ms = 0;
  const std::string yaml = WriteResolved(scenario);
  RC_LOG() << yaml;
  try {
    const Scenario again = ReadBack(yaml);
    ExpectSame(scenario, again);
    RC_ASSERT(WriteResolved(again) == yaml);
  } catch (const ScenarioError& error) {
    RC_FAIL(error.what());
  }
}

TEST_F(ResolvedTest, WritesEveryDefault) {
  const Scenario scenario =
      ReadBack("name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0.1, 2]}\n");
  EXPECT_EQ(WriteResolved(scenario), R"(format: 1
name: "x"
tags: []
model: "tiltrotor"
allow_invalid_inertia: false
firmware: "paper"
firmware_parameters: []
clients: []
lines: []
arbiter:
  type: single
expect: pass
allow_restarts: false
held: false
sensor_noise: true
control_period:
  tolerance_percent: 1
clean_line:
  periods_count: 1
start_within_s: 10
seed: 1
duration_s: 24
step_s: 0.004
delay_margin_s: 0.009
angular_rates: world
initial:
  position_m: [0, 0.1, 2]
  on_ground: false
  attitude_rad: [0, 0, 0]
ground: end
link:
  ideal: false
  baud: 921600
  reference_baud: 921600
  data_bits: 8
  parity: none
  stop_bits: 1
  protocol: paper
  adapter_latency_ms: 0
reference:
  type: hover
  at_m: [0, 0.1, 2]
  yaw_rad: 0
  velocity: true
faults: []
criteria: []
watch: []
)");
}

TEST_F(ResolvedTest, MakesFilesAbsolute) {
  const Scenario scenario =
      ReadBack("name: x\nmodel: own.sdf\nduration_s: 24\nreference: {type: recorded, file: path.csv}\n");
  const Scenario again = ReadBack(WriteResolved(scenario));
  EXPECT_EQ(again.model, (folder_ / "own.sdf").string());
  EXPECT_EQ(std::get<RecordedReference>(again.reference.path).file, folder_ / "path.csv");
}

}  // namespace
}  // namespace tiltproof::harness
