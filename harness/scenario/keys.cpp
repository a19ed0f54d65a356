#include "harness/scenario/keys.h"

#include <algorithm>
#include <limits>
#include <type_traits>
#include <utility>
#include <variant>

#include "harness/scenario/fault_keys.h"
#include "harness/scenario/protocol_file.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::harness {
namespace {

constexpr auto kRequired = Presence::kRequired;

constexpr Range kPosition_m = {-1000, 1000};  // beyond it a flight counts as diverged
constexpr Range kSize_m = {0, 1000};
constexpr Range kPeriod_s = {0.1, 86400};
constexpr double kShortest_s = 0.00001;
constexpr double kMax = 1e9;

// A name that is taken already.
constexpr TextRule NameExcept(std::span<const std::string_view> reserved, std::string_view reserved_for) {
  TextRule rule = kNameRule;
  rule.reserved = reserved;
  rule.reserved_for = reserved_for;
  return rule;
}

constexpr TextRule kScenarioName = NameExcept(kRunFiles, "the name of a file of the results");
constexpr TextRule kCriterionName = NameExcept(kImplicitCriteria, "a criterion that every scenario has");
constexpr TextRule kWord = {"[a-z0-9_]+", "lower-case letters, digits and '_'", 100};
constexpr TextRule kMetric = {"[A-Za-z0-9_]+(\\.[A-Za-z0-9_]+)+", "a dotted name such as tracking.rmse_m",
                              100};
constexpr TextRule kVariable = {
    "[A-Za-z_]([A-Za-z0-9_.:-]|\\[|\\])*",
    "a variable of the firmware's image, such as tick_count, controller.gains[3] or motor.c:state", 200};
constexpr TextRule kAnyText = {};

void DescribeExpectation(KeyVisitor& v, Expectation& expect) {
  constexpr std::array kVerdicts = {Verdict::kPass, Verdict::kFail, Verdict::kInconclusive, Verdict::kError};
  std::array<std::string_view, kVerdicts.size()> words;
  std::transform(kVerdicts.begin(), kVerdicts.end(), words.begin(),
                 [](Verdict verdict) { return Name(verdict); });
  const auto index = [&](Verdict verdict) {
    return static_cast<std::size_t>(std::find(kVerdicts.begin(), kVerdicts.end(), verdict) -
                                    kVerdicts.begin());
  };
  NamedChoices choices{index(expect.verdict), {}};
  for (const auto& [name, verdict] : expect.by_firmware) choices.by_name.emplace_back(name, index(verdict));
  v.ChoiceByName({"expect",
                  "The verdict that makes the run green, or one for each build of the firmware; a build "
                  "that is not named is to pass"},
                 words, choices, kWord);
  expect = {kVerdicts[choices.all], {}};
  for (const auto& [name, place] : choices.by_name) expect.by_firmware.emplace_back(name, kVerdicts[place]);
}

void DescribeInitial(KeyVisitor& v, Scenario& s) {
  v.Point({"position_m", "World position of the main body's origin; absent: the reference's start",
           Presence::kDerived},
          s.initial_position_m, kPosition_m);
  v.Bool({"on_ground",
          "Stand on the ground, at rest: the height follows from the vehicle's shapes, so the z of "
          "position_m must be 0. Needs `ground: {solid: true}`"},
         s.initial_on_ground);
  v.Point({"attitude_rad", "Roll, pitch, yaw (Z-Y-X Euler angles)"}, s.initial_attitude_rad, {-3.2, 3.2});
}

void DescribeGround(KeyVisitor& v, Scenario& s) {
  v.WordOrSection(
      {"ground", "The plane z = 0. `end`: any touch ends the flight and fails `survival`"}, "end",
      s.solid_ground.has_value(), [&](KeyVisitor& w) {
        if (!s.solid_ground) s.solid_ground.emplace();
        bool solid = true;
        w.Bool({"solid", "true: the vehicle may start on the ground, land on it and leave it", kRequired},
               solid);
        w.Number({"touch_down_max_m_s",
                  "A touch ends the flight and fails `survival` when the touching point comes "
                  "down faster than this"},
                 s.solid_ground->touch_down_max_m_s, {0.001, 100});
      });
}

// Only the checks can read the file, or make a protocol of the mapping (scenario_checks.cpp). `without`: the name that
// means that there is none; empty where one is needed.
void DescribeProtocolOf(KeyVisitor& v, const Key& key, std::shared_ptr<const link::Protocol>& protocol,
                        std::string_view without = {}) {
  const auto shipped = ShippedProtocolNames();
  std::vector<std::string_view> names(shipped.begin(), shipped.end());
  if (!without.empty()) names.insert(names.begin(), without);
  // Compared by name, because a scenario has the protocol as its vehicle speaks it.
  const bool has_file =
      protocol != nullptr && std::find(shipped.begin(), shipped.end(), protocol->name) == shipped.end();
  std::string name = has_file ? "" : protocol == nullptr ? std::string(without) : protocol->name;
  v.NameOrSection(key, names, name, [&](KeyVisitor& w) {
    ProtocolSpec spec = has_file ? SpecOf(*protocol) : ProtocolSpec();
    DescribeProtocol(w, spec);
  });
  if (!without.empty() && name == without)
    protocol = nullptr;
  else if (auto found = FindProtocol(name))
    protocol = std::move(found);
}

void DescribeLine(KeyVisitor& v, LineEntry& line) {
  v.Text({"id", "Unique in the scenario; the target of faults on it", Presence::kRequired}, line.id,
         kClientRule);
  v.Texts({"between", "Ids of the two clients at its ends", Presence::kRequired}, line.between, kClientRule);
  v.Integer({"baud", "Bits per second; a byte takes 10 bits (8N1)"}, line.baud, {1200, 10e6});
  DescribeProtocolOf(v,
                     {"protocol",
                      "Where the line's frames end, for faults on frames: a protocol's name or file. "
                      "`bytes`: nothing is known of them. `from: client` is then the first of `between`"},
                     line.protocol, kBytesAsTheyAre);
}

void DescribeLink(KeyVisitor& v, LinkSpec& link) {
  v.Bool({"ideal", "Bytes take no time: an input computed from a sample is in force at once"}, link.ideal);
  v.Integer({"baud", "Bits per second of the main line; a byte takes 10 bits by default"}, link.baud,
            {1200, 10e6});
  v.Integer({"reference_baud", "The same of the reference line"}, link.reference_baud, {1200, 10e6});
  v.Integer(
      {"data_bits", "Data bits of a byte, 7 or 8, on both lines. With 7 the top bit of every byte is lost"},
      link.character.data_bits, {7, 8});
  Enumeration(v, {"parity", "Parity bit behind the data bits, on both lines"}, link::kParities,
              link.character.parity);
  v.Integer({"stop_bits", "Stop bits behind each byte, 1 or 2, on both lines"}, link.character.stop_bits,
            {1, 2});
  DescribeProtocolOf(
      v,
      {.name = "protocol",
       .doc = "The messages of the line: of the paper, of the authors' published server, of the paper with "
              "sequence, time and CRC-32, or of a protocol file (docs/protocol.md), relative to the "
              "scenario's file",
       .other_name = "dialect"},
      link.protocol);
  v.Number({"adapter_latency_ms", "Buffering of a USB-serial adapter, on frames towards the plant"},
           link.adapter_latency_ms, {0, 1000});
  v.MaybeSection({"adapter", "A USB-serial adapter with a buffer, in both directions of the main line"},
                 link.adapter.has_value(), [&](KeyVisitor& w) {
                   if (!link.adapter) link.adapter.emplace();
                   w.Number({"latency_ms", "The buffer is passed on this long after its first byte"},
                            link.adapter->latency_ms, {0, 1000});
                   w.Integer({"bytes_count", "The buffer is passed on when it holds so many bytes"},
                             link.adapter->bytes_count, {1, 65536});
                 });
}

constexpr Key kStart = {"start_m", "Position at t = 0"};

void DescribePath(KeyVisitor& v, HoverReference& r) {
  v.Point({"at_m", "Where to stay", kRequired}, r.at_m, kPosition_m);
  v.Number({"yaw_rad", "Heading"}, r.yaw_rad, {-100, 100});
}
void DescribePath(KeyVisitor& v, SpiralReference& r) {
  v.Number({"turns_count", "n of eq. (1); negative: clockwise"}, r.turns_count, {-1000, 1000});
  v.Number({"radius_m", "d of eq. (1)"}, r.radius_m, kSize_m);
  v.Number({"height_m", "h of eq. (1), the climb"}, r.height_m, kPosition_m);
  v.Point(kStart, r.start_m, kPosition_m);
  v.Number({"time_s", "T_f of eq. (1), independent of duration_s; then the end point is held"}, r.time_s,
           kPeriod_s);
}
void DescribePath(KeyVisitor& v, WaypointsReference& r) {
  v.Points({"points_m", "Corners, the first at t = 0; the last is held", kRequired}, r.points_m, kPosition_m);
  v.Number({"speed_m_s", "Speed along the straight lines"}, r.speed_m_s, {0.001, 100});
}
void DescribePath(KeyVisitor& v, CircleReference& r) {
  v.Number({"radius_m", "Radius; the centre is this far from the start, towards -x"}, r.radius_m, kSize_m);
  v.Number({"period_s", "Time of one turn"}, r.period_s, kPeriod_s);
  v.Point(kStart, r.start_m, kPosition_m);
}
void DescribePath(KeyVisitor& v, EightReference& r) {
  v.Number({"width_m", "Extent along x; along y it is half of this"}, r.width_m, kSize_m);
  v.Number({"period_s", "Time of one figure"}, r.period_s, kPeriod_s);
  v.Point({"start_m", "The crossing, where the figure begins"}, r.start_m, kPosition_m);
}
void DescribePath(KeyVisitor& v, StraightReference& r) {
  v.Point({"from_m", "Position at t = 0", kRequired}, r.from_m, kPosition_m);
  v.Point({"to_m", "Position at time_s, then held", kRequired}, r.to_m, kPosition_m);
  v.Number({"time_s", "Time from one end to the other"}, r.time_s, kPeriod_s);
}
void DescribePath(KeyVisitor& v, RecordedReference& r) {
  std::string file = r.file.string();
  v.Text(
      {"file",
       "CSV with the columns t_s,x_m,y_m,z_m,yaw_rad[,vx_m_s,vy_m_s,vz_m_s], relative to the scenario's file",
       kRequired},
      file, kAnyText);
  r.file = file;
}

using Path = decltype(ReferenceSpec::path);
constexpr std::array<Alternative, std::variant_size_v<Path>> kPaths = {{
    {"hover", "Stay at one point"},
    {"spiral", "The paper's climbing spiral, eq. (1)"},
    {"waypoints", "Straight lines from point to point"},
    {"circle", "A level circle"},
    {"eight", "A level figure of eight"},
    {"line", "One straight line"},
    {"recorded", "A path from a CSV file"},
}};

template <std::size_t... i>
void SetAlternative(Path& path, std::size_t index, std::index_sequence<i...>) {
  ((index == i ? void(path.emplace<i>()) : void()), ...);
}

void DescribeReference(KeyVisitor& v, ReferenceSpec& reference) {
  v.Alternatives({"type", "Shape of the path", kRequired}, kPaths, reference.path.index(),
                 [&](KeyVisitor& w, std::size_t index) {
                   if (reference.path.index() != index)
                     SetAlternative(reference.path, index, std::make_index_sequence<kPaths.size()>());
                   std::visit([&](auto& path) { DescribePath(w, path); }, reference.path);
                 });
  v.Bool({"velocity", "Send the path's velocity too; false: it is sent as 0"}, reference.velocity);
}

void DescribeCriterion(KeyVisitor& v, CriterionSpec& criterion) {
  v.Text({"name", "Unique in the scenario", kRequired}, criterion.name, kCriterionName);
  v.Text({"stl", "A formula of signal temporal logic; either this or metric"}, criterion.stl, kAnyText);
  v.Text({"metric", "A metric with a bound"}, criterion.metric, kMetric);
  v.MaybeNumber({"min", "Least value of the metric that passes"}, criterion.min, {-kMax, kMax});
  v.MaybeNumber({"max", "Largest value of the metric that passes"}, criterion.max, {-kMax, kMax});
  v.ExactlyOne(
      "a criterion",
      std::array{
          KeyGroup{"stl"},
          KeyGroup{"metric", {"min", "max"}, "bounds belong to a 'metric'; write them into the formula"}});
}

void DescribeClient(KeyVisitor& v, ClientEntry& client) {
  v.Text({"id", "Unique in the scenario; part of the names of its columns, metrics and files", kRequired},
         client.id, kClientRule);
  v.Text({"firmware", "Build of the firmware; absent: the scenario's `firmware`"}, client.firmware, kWord);
}

void DescribeFirmwareParameter(KeyVisitor& v, FirmwareParameter& parameter) {
  v.Text({"name", "Unique in the list, and known to the firmware", kRequired}, parameter.name, kWord);
  v.Number({"value", "Its value", kRequired}, parameter.value, {-kMax, kMax});
}

void DescribeFirmware(KeyVisitor& v, Scenario& s) {
  v.Text(
      {"firmware",
       "Build of the firmware: paper, tolerant, paper_published, failover, triplex, or lqr for any vehicle"},
      s.firmware, kWord);
  v.Text({"gain",
          "The gain of the build lqr, and of a library that takes parameters: design, or a CSV file of "
          "design-lqr, relative to the scenario's file"},
         s.gain, kAnyText);
  ListOf(v,
         {"firmware_parameters",
          "Numbers for a library or program that takes parameters; their meaning is the firmware's"},
         s.firmware_parameters, DescribeFirmwareParameter);
}

constexpr std::array<Alternative, 5> kArbiters = {{
    {"single", "Only the commands of one client take effect"},
    {"primary_backup", "Those of the first client in an order that is not silent"},
    {"active_claims", "Those of the client that says that it is active (tiltproof_client_role)"},
    {"mid_value", "The median of all clients, for each input"},
    {"duplex_compare", "Those of the first of two clients, as long as both agree"},
}};

void DescribeArbiterOf(KeyVisitor& v, ArbiterType type, ArbiterSpec& arbiter) {
  if (type == ArbiterType::kSingle) {
    v.Text({"client", "Whose commands take effect; absent: the first client's. Its `start` is t = 0"},
           arbiter.client, kClientRule);
    return;
  }
  v.MaybeNumber({"timeout_ms",
                 "A client counts for so long after its last accepted actuator message; absent: three "
                 "control periods"},
                arbiter.timeout_ms, {0.001, 1e6});
  if (type == ArbiterType::kPrimaryBackup) {
    v.Texts({"order", "Ids of clients, the first choice first; absent: all, in the order of `clients`"},
            arbiter.order, kClientRule);
    v.NumberOr({"return",
                "An earlier client flies again after so many milliseconds of messages without a gap. `never` "
                "does not hold back the first one from its very first message"},
               "never", arbiter.return_ms, {0, 1e9});
  }
  if (type == ArbiterType::kDuplexCompare) {
    v.Number({"tolerance_percent",
              "The two agree when each input differs by at most so much of the input's range", kRequired},
             arbiter.tolerance_percent, {0, 100});
    v.Text({"on_disagreement",
            "The input while they disagree: `hold` the last one, the vehicle's at `hover`, or that of the "
            "client of this id"},
           arbiter.on_disagreement, kClientRule);
  }
}

void DescribeArbiter(KeyVisitor& v, ArbiterSpec& arbiter) {
  v.Alternatives({"type", "How the commands of several clients become the vehicle's input"}, kArbiters,
                 static_cast<std::size_t>(arbiter.type), [&](KeyVisitor& w, std::size_t index) {
                   arbiter.type = static_cast<ArbiterType>(index);
                   DescribeArbiterOf(w, arbiter.type, arbiter);
                 });
}

void DescribeTimes(KeyVisitor& v, Scenario& s) {
  v.Seconds({"duration_s",
             "Length of the flight from the accepted start; its log takes about 8 MiB of memory per minute",
             kRequired},
            s.duration_ns, {kShortest_s, 14400});
  v.Seconds({"stop_s",
             "The flight is stopped here, before duration_s, as a script does; criteria may stay undecided"},
            s.stop_ns, {kShortest_s, 14400});
  v.Seconds({"step_s", "Step of the plant's integration; must divide the protocol's control period (0.012)"},
            s.step_ns, {kShortest_s, 1});
  v.Seconds(
      {"delay_margin_s",
       "Delay that the loop of vehicle and firmware tolerates; in real time, this machine is late after "
       "a third of it"},
      s.delay_margin_ns, {0.0001, 10});
}

// Criteria that every scenario has.
void DescribeOwnCriteria(KeyVisitor& v, Scenario& s) {
  v.Section({"control_period", "The criterion of that name, which every scenario has"}, [&](KeyVisitor& w) {
    w.Number(
        {"tolerance_percent",
         "How far the median interval between the firmware's requests may be from the protocol's period"},
        s.control_period_tolerance_percent, {0.001, 1000});
  });
  v.Section({"clean_line", "The criterion of that name, which every scenario has"}, [&](KeyVisitor& w) {
    w.Integer({"periods_count",
               "How many periods may lack a request or an actuator message, or have a second request; above "
               "1, so many malformed frames are accepted, too"},
              s.clean_line_periods_count, {0, 1'000'000});
  });
}

}  // namespace

void DescribeScenario(KeyVisitor& v, Scenario& s) {
  v.Integer({"format", "Format of this file; a tiltproof that knows only older formats refuses it"}, s.format,
            {1, static_cast<double>(kScenarioFormat)});
  v.Text({"name", "Unique within a run; names the result folder", kRequired}, s.name, kScenarioName);
  v.Text({"description", "What the scenario is about, for people"}, s.description, kAnyText);
  v.Texts({"tags", "Words by which scenarios are selected"}, s.tags, kNameRule);
  v.Text(
      {"model",
       "The vehicle: a name that tiltproof ships, or a path ending in .sdf, relative to the scenario's file"},
      s.model, kAnyText);
  v.Bool({"allow_invalid_inertia", "Fly a model even if its inertia is physically impossible"},
         s.allow_invalid_inertia);
  DescribeFirmware(v, s);
  ListOf(v, {"clients", "Several clients on the vehicle, each with its own lines; absent: one, `main`"},
         s.clients, DescribeClient);
  ListOf(v,
         {"lines",
          "Serial lines between clients. In the order of this list they are a client's UARTs from 2 on"},
         s.lines, DescribeLine);
  v.Section({"arbiter", "Which of several clients moves the vehicle"},
            [&](KeyVisitor& w) { DescribeArbiter(w, s.arbiter); });
  DescribeExpectation(v, s.expect);
  v.Bool({"allow_restarts",
          "Accept restarts of the firmware that no fault asked for; false: they fail `survival`"},
         s.allow_restarts);
  v.Bool({"held", "Hold the vehicle on a test stand: it stays as it is at the start, whatever is commanded"},
         s.held);
  v.Bool({"sensor_noise",
          "false: the sensors of the vehicle's file have no noise and no bias; faults keep theirs"},
         s.sensor_noise);
  DescribeOwnCriteria(v, s);
  v.Seconds({"start_within_s",
             "Time from power-on in which `start` must come; a longer flight waits as long as it lasts. "
             "Until then, an image that is busy does not count as hung"},
            s.start_within_ns, {0.1, 3600});
  // JSON and JavaScript hold integers exactly up to 2^53 - 1.
  auto seed = static_cast<std::int64_t>(s.seed);
  v.Integer({"seed", "All random draws derive from it"}, seed, {0, 9007199254740991});
  s.seed = static_cast<std::uint64_t>(seed);
  DescribeTimes(v, s);
  Enumeration(
      v,
      {"angular_rates",
       "Angular rates of the sensors: about the world's axes, about the body's axes, or of the Euler angles"},
      std::array{AngularRates::kWorld, AngularRates::kBody, AngularRates::kEuler}, s.angular_rates);
  v.Section({"initial", "The vehicle before the start"}, [&](KeyVisitor& w) { DescribeInitial(w, s); });
  DescribeGround(v, s);
  v.Section({"link", "The serial lines"}, [&](KeyVisitor& w) { DescribeLink(w, s.link); });
  v.Section({"reference", "The path that the base station asks for", kRequired},
            [&](KeyVisitor& w) { DescribeReference(w, s.reference); });
  ListOf(v, {"faults", "What goes wrong"}, s.faults, DescribeFault);
  ListOf(v, {"criteria", "What counts as success"}, s.criteria, DescribeCriterion);
  v.Texts({"watch", "Variables of an emulated image that become columns watch_<variable> of the trace"},
          s.watch, kVariable);
}

}  // namespace tiltproof::harness
