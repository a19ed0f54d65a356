// A flight's log over the bus is the log that one process would have kept.
#include "harness/run/realtime/log_messages.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "firmware/messages.h"
#include "harness/dds/domain_slot.h"
#include "harness/run/merge_logs.h"
#include "harness/run/remote/archive.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/run/by_hand.h"
#include "tests/support/control_period.h"
#include "tests/support/origins.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

Scenario TroubledScenario() {
  Scenario scenario;
  scenario.duration_ns = kNsPerS;
  scenario.initial_position_m = {0, 0, 2};
  scenario.reference = {HoverReference{{0, 0, 2}, 0}};
  faults::FaultSpec flips;
  flips.id = "flips";
  flips.type = "wire.bit_error";
  flips.target = faults::Target::kBoth;
  flips.parameters = {{"ber", 0.002}};
  faults::FaultSpec bias;
  bias.id = "bias";
  bias.type = "sensor.bias";
  bias.start_ns = 200 * kNsPerMs;
  bias.end_ns = 600 * kNsPerMs;
  bias.parameters = {{"signal", std::string("z_m")}, {"offset", 0.1}};
  scenario.faults = {flips, bias};
  return scenario;
}

// When a made-up client wakes up for the first time.
constexpr BootTime kBegin(5'000'000'000'123);

// One flight, by hand: the client asks every period and sends the hover input 3 ms later. `line_counts`: the
// plant's rows know the counters, as in one process.
struct ByHand {
  explicit ByHand(const Scenario& scenario_in, bool line_counts_in)
      : scenario(scenario_in), line_counts(line_counts_in), line(scenario), server(scenario, Model()) {}

  void Pump(BootTime now) {
    for (;;) {
      BootTime next = std::min(line.NextArrival(Direction::kToPlant), line.NextArrival(Direction::kToClient));
      if (next > now) break;
      Advance(next);
      while (const auto piece = line.TakePiece(Direction::kToPlant, next)) {
        if (piece->message == nullptr) continue;
        if (origin.Note(piece->arrival_ns, *piece->message)) line.SetOrigin(origin.origin());
        server.Receive(0, piece->arrival_ns, *piece->message, [&](std::span<const std::uint8_t> frame) {
          line.Transmit(Direction::kToClient, piece->arrival_ns, frame);
        });
      }
      while (line.TakePiece(Direction::kToClient, next)) {
      }
    }
  }
  void Advance(BootTime now) {
    // As the link node does: as the counters stood before anything of this instant.
    for (; line.origin().known() && line.origin().ToBootTime(next_sample_ns) < now &&
           next_sample_ns <= scenario.duration_ns;
         next_sample_ns += kControlPeriodNs)
      samples.push_back({next_sample_ns, line.counts()});
    server.Advance(now, {line_counts ? line.counts() : LineCounts{}});
  }
  void Fly(const std::function<void()>& every_50_ms) {
    line.Transmit(Direction::kToPlant, kBegin, FrameOf(link::EncodeStart(link::Dialect::kPaper, {})));
    for (BootTime t = kBegin; t < kBegin + 800 * kNsPerMs; t += kControlPeriodNs) {
      line.Transmit(Direction::kToPlant, t, FrameOf(link::EncodeReadSensors(link::Dialect::kPaper)));
      Pump(t + 3 * kNsPerMs);
      line.Transmit(
          Direction::kToPlant, t + 3 * kNsPerMs,
          FrameOf(link::EncodeActuators(
              link::Dialect::kPaper, ToFloat(testing::ActuatorsOf(Model().HoverInput()), kActuatorFields))));
      Pump(t + 10 * kNsPerMs);
      if ((t - kBegin) / kControlPeriodNs % 4 == 3) every_50_ms();
    }
  }

  const Scenario scenario;
  bool line_counts;
  LocalLine line;
  OriginFinder origin;
  LocalPlantServer server;
  std::vector<CountsSample> samples;
  TimeNs next_sample_ns = 0;
};

// A node's publisher and the harness's collector, on one bus.
class LogMessagesTest : public ::testing::Test {
 protected:
  LogMessagesTest() : bus_({.domain = slot_.domain(), .tag = "test"}) {
    circle_.Admit(bus_.participant(), {});
  }

  // Until the collector has all of these nodes.
  bool Gather(LogCollector& collector, const std::vector<std::string>& nodes,
              const std::vector<LogPublisher*>& publishers) {
    return condition_.Wait([&] {
      for (LogPublisher* publisher : publishers) publisher->Retry();
      collector.Drain(flown_ns_);
      return std::all_of(nodes.begin(), nodes.end(),
                         [&](const std::string& node) { return collector.Complete(node); });
    });
  }

  dds::DomainSlot slot_;
  dds::Bus bus_;
  dds::Circle circle_;
  dds::Condition condition_;
  TimeNs flown_ns_ = 0;
};

MATCHER(SameActivation, "") {
  const auto& [a, b] = arg;
  const auto same = [](const auto& x, const auto& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(), [](const auto& c, const auto& d) {
      return c.begin_ns == d.begin_ns && c.bytes == d.bytes;
    });
  };
  return a.time_ns == b.time_ns && a.fault == b.fault && a.what == b.what && same(a.before, b.before) &&
         same(a.after, b.after);
}
MATCHER(SameEvent, "") {
  const auto& [a, b] = arg;
  return a.time_ns == b.time_ns && a.kind == b.kind && a.text == b.text;
}
MATCHER(SameNumber, "") {
  const auto& [a, b] = arg;
  return a == b || (std::isnan(a) && std::isnan(b));
}

TEST_F(LogMessagesTest, AFlightOverTheBusIsTheFlightOfOneProcess) {
  const Scenario scenario = TroubledScenario();
  ByHand together(scenario, true);
  together.Fly([] {});
  RunLog expected;
  expected.trace = Trace(TraceLayout(Model().signals(), scenario).columns);
  expected.fault_activation_counts.assign(scenario.faults.size(), 0);
  const Origin origin = together.line.origin();
  ASSERT_TRUE(origin.known());
  const BootTime end = origin.ToBootTime(800 * kNsPerMs);
  Append(expected, together.server.TakeLog());
  Append(expected, together.line.TakeLog(end), 0, origin);
  SortByTime(expected);
  ASSERT_GT(expected.fault_activation_counts.at(0), 3);
  ASSERT_GT(expected.fault_activation_counts.at(1), 3);
  ASSERT_GT(expected.trace.row_count(), 60u);

  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher plant(bus_, scenario, "run", "plant", bus_.participant()),
      link(bus_, scenario, "run", "link", bus_.participant());
  ByHand apart(scenario, false);
  apart.Fly([&] {
    plant.Write(apart.server.TakeLog());
    if (!apart.line.origin().known()) return;
    link.Write(apart.line.TakeLog(end), apart.line.origin(), std::exchange(apart.samples, {}));
    collector.Drain(flown_ns_);
  });
  PlantLog rest = apart.server.TakeLog();
  plant.Write(rest);
  NodeTotals plant_totals;
  plant_totals.plant.emplace();
  plant_totals.plant->hover_input = rest.hover_input;
  plant_totals.plant->input_min = rest.input_min;
  plant_totals.plant->input_max = rest.input_max;
  plant_totals.plant->clients[0].starts_accepted_count = rest.clients[0].starts_accepted_count;
  plant_totals.plant->activation_counts = rest.activation_counts;
  plant_totals.lateness.origin = origin;
  const BootTime t0 = origin.boot_time();
  plant_totals.lateness.spans = {{t0 - 9, t0 - 1}, {t0 - 2, t0 + 5}, {t0 + 1, t0 + 9}};
  plant_totals.lateness.disturbed = {{t0 + 20, t0 + 21}, {t0 - 5, t0 - 4}, {t0 + 3, t0 + 4}};
  LineLog line_rest = apart.line.TakeLog(end);
  link.Write(line_rest, apart.line.origin(), std::exchange(apart.samples, {}));
  NodeTotals link_totals;
  link_totals.line.emplace(line_rest);
  link_totals.line->link = {};
  link_totals.line->events.clear();
  link_totals.line->activations.clear();
  link_totals.line->reply_latency_ns.clear();
  link_totals.line->client_round_trip_ns.clear();
  link_totals.lateness.spans = {{BootTime(1), BootTime(2)}};  // without t = 0: it is unknown when that was
  EXPECT_EQ(collector.Missing("link"), "its closing report");
  plant.Close(plant_totals);
  link.Close(link_totals);
  ASSERT_TRUE(Gather(collector, {"plant", "link"}, {&plant, &link})) << collector.Missing("link");
  const RunLog log = collector.Take(777);

  EXPECT_EQ(log.end_ns, 777);
  EXPECT_EQ(log.trace.columns(), expected.trace.columns());
  ASSERT_EQ(log.trace.row_count(), expected.trace.row_count());
  for (std::size_t row = 0; row < log.trace.row_count(); ++row)
    EXPECT_THAT(log.trace.row(row), ::testing::Pointwise(SameNumber(), expected.trace.row(row))) << row;
  EXPECT_EQ(log.link.content(), expected.link.content());
  EXPECT_EQ(log.clients[0].request_times_ns, expected.clients[0].request_times_ns);
  EXPECT_EQ(log.clients[0].actuator_times_ns, expected.clients[0].actuator_times_ns);
  EXPECT_EQ(log.clients[0].reply_latency_ns, expected.clients[0].reply_latency_ns);
  EXPECT_EQ(log.clients[0].client_round_trip_ns, expected.clients[0].client_round_trip_ns);
  EXPECT_THAT(log.events, ::testing::UnorderedPointwise(SameEvent(), expected.events));
  EXPECT_THAT(log.activations, ::testing::UnorderedPointwise(SameActivation(), expected.activations));
  EXPECT_EQ(log.fault_activation_counts, expected.fault_activation_counts);
  EXPECT_EQ(log.hover_input, expected.hover_input);
  EXPECT_EQ(log.input_min, expected.input_min);
  EXPECT_EQ(log.input_max, expected.input_max);
  EXPECT_EQ(log.clients[0].starts_accepted_count, 1);
  EXPECT_EQ(log.clients[0].accepted_wrong_count, expected.clients[0].accepted_wrong_count);
  EXPECT_EQ(log.clients[0].accepted_stale_count, expected.clients[0].accepted_stale_count);
  EXPECT_EQ(log.clients[0].resync_max_ns, expected.clients[0].resync_max_ns);
  for (std::size_t i = 0; i < log.clients[0].counts.size(); ++i) {
    EXPECT_EQ(log.clients[0].counts[i].frames_sent, expected.clients[0].counts[i].frames_sent);
    EXPECT_EQ(log.clients[0].counts[i].frames_accepted, expected.clients[0].counts[i].frames_accepted);
    EXPECT_EQ(log.clients[0].counts[i].frames_rejected, expected.clients[0].counts[i].frames_rejected);
    EXPECT_EQ(log.clients[0].counts[i].bytes_corrupted, expected.clients[0].counts[i].bytes_corrupted);
  }
  EXPECT_THAT(log.harness_late, ElementsAre(LateSpan{-2, 5}, LateSpan{1, 9}));
  EXPECT_THAT(log.board_disturbed, ElementsAre(LateSpan{3, 4}, LateSpan{20, 21}));
}

TEST_F(LogMessagesTest, WhatAnotherRunSaysIsNoPartOfThisOne) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher old(bus_, scenario, "old run", "plant", bus_.participant()),
      now(bus_, scenario, "run", "plant", bus_.participant());
  old.Write(RunEvent{1, "old", ""});
  now.Write(RunEvent{2, "new", ""});
  old.Close({});
  now.Close({});
  ASSERT_TRUE(Gather(collector, {"plant"}, {&old, &now}));
  const RunLog log = collector.Take(0);
  ASSERT_EQ(log.events.size(), 1u);
  EXPECT_EQ(log.events[0].kind, "new");
}

// A node that was held up has more to say at once than one message can hold.
TEST_F(LogMessagesTest, ALogOfAnyLengthGoesOut) {
  const Scenario scenario = TroubledScenario();
  const std::size_t columns = TraceLayout(Model().signals(), scenario).columns.size();
  const std::size_t rows = 2 * dds::kNumbersCountMax / columns + 1;
  PlantLog log;
  log.column_count = columns;
  std::vector<CountsSample> samples;
  for (std::size_t row = 0; row < rows; ++row) {
    log.rows.resize(log.rows.size() + columns, static_cast<double>(row));
    log.rows[row * columns] = ToSeconds(static_cast<TimeNs>(row) * kControlPeriodNs);
  }
  for (TimeNs i = 0; i < 20'000; ++i) samples.push_back({i * kControlPeriodNs, {}});
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher node(bus_, scenario, "run", "node", bus_.participant());
  node.Write(log);
  node.Write(LineLog{}, kOriginAtPowerOn, samples);
  node.Close({});
  ASSERT_TRUE(Gather(collector, {"node"}, {&node})) << collector.Missing("node");
  const RunLog taken = collector.Take(0);
  ASSERT_EQ(taken.trace.row_count(), rows);
  for (std::size_t row = 0; row < rows; ++row) ASSERT_EQ(taken.trace.at(row, 1), static_cast<double>(row));
}

TEST_F(LogMessagesTest, WhatAFirmwareSaysCannotStopItsNode) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher client(bus_, scenario, "run", "client", bus_.participant());
  client.Write(RunEvent{kNsPerS, "firmware_log", std::string("a\0b", 3)});
  client.Write(RunEvent{0, "node_event", std::string(2 * dds::kTextBytesMax, 'x')});
  for (int i = 0; i < 3000; ++i) client.Write(RunEvent{0, "firmware_log", std::string(1000, 'y')});
  client.Close({});
  ASSERT_TRUE(Gather(collector, {"client"}, {&client})) << collector.Missing("client");
  const RunLog log = collector.Take(0);
  EXPECT_TRUE(log.clients[0].firmware_log.starts_with("1.000000 a?b\n0.000000 yyy"));
  EXPECT_LT(log.clients[0].firmware_log.size(), kFirmwareLogBytesMax + 2000);
  EXPECT_GT(log.clients[0].firmware_log.size(), kFirmwareLogBytesMax / 2);
  ASSERT_EQ(log.events.size(), 1u);
  EXPECT_EQ(log.events[0].text.size(), dds::kTextBytesMax);
}

// A node's log grows with the flight. What a node sends beyond that is not kept, and the node is named.
TEST_F(LogMessagesTest, NoNodeCanFillTheHarnesssMemory) {
  const Scenario scenario = TroubledScenario();
  const std::size_t columns = TraceLayout(Model().signals(), scenario).columns.size();
  PlantLog much;
  // Kept, it takes more than a flight that has just begun may hold, and less than one of 60 s.
  const std::size_t rows = LogCollector::kNodeBytesMax / (sizeof(double) * columns) * 3 / 4;
  much.column_count = columns;
  much.rows.resize(rows * columns);
  for (std::size_t row = 0; row < rows; ++row) much.rows[row * columns] = static_cast<double>(row);
  for (const TimeNs flown_ns : {TimeNs{0}, 60 * kNsPerS}) {
    flown_ns_ = flown_ns;
    const std::string run = fmt::format("run at {}", flown_ns);
    LogCollector collector(bus_, circle_, scenario, Model().signals(), run, condition_.Waker());
    LogPublisher plant(bus_, scenario, run, "plant", bus_.participant()),
        link(bus_, scenario, run, "link", bus_.participant());
    plant.Write(much);
    if (flown_ns == 0) {
      ASSERT_TRUE(condition_.Wait([&] {
        plant.Retry();
        collector.Drain(flown_ns_);
        return !collector.overfull().empty();
      }));
    }
    plant.Write(RunEvent{2, "after", ""});
    plant.Close({});
    ASSERT_TRUE(Gather(collector, {"plant"}, {&plant})) << collector.Missing("plant");
    link.Write(RunEvent{1, "of another node", ""});
    link.Close({});
    ASSERT_TRUE(Gather(collector, {"link"}, {&link})) << collector.Missing("link");
    const std::string overfull = collector.overfull();
    const RunLog log = collector.Take(0);
    std::vector<std::string> kinds;
    for (const RunEvent& event : log.events) kinds.push_back(event.kind);
    if (flown_ns == 0) {
      EXPECT_EQ(
          overfull,
          "the plant node sends more log than a flight can hold: more than 64 MiB and 4 MiB for each second "
          "flown");
      EXPECT_LT(log.trace.row_count(), rows);
      EXPECT_GT(log.trace.row_count(), rows / 3);
      EXPECT_THAT(kinds, ElementsAre("of another node"));
    } else {
      EXPECT_EQ(overfull, "");
      EXPECT_EQ(log.trace.row_count(), rows);
      EXPECT_THAT(kinds, ElementsAre("of another node", "after"));
    }
  }
}

TEST_F(LogMessagesTest, BadMessagesDoNoHarm) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  dds::Publisher<dds::FaultActivation> activations(bus_);
  dds::Publisher<dds::TraceRows> rows(bus_);
  dds::Publisher<dds::SerialTap> taps(bus_);
  dds::Publisher<dds::NodeReport> reports(bus_);
  ASSERT_TRUE(condition_.Wait([&] {
    return activations.MatchedCount() == 1 && rows.MatchedCount() == 1 && taps.MatchedCount() == 1 &&
           reports.MatchedCount() == 1;
  }));
  const auto named = [](auto message) {
    message.run_id = "run";
    message.node_id = "plant";
    return message;
  };
  dds::FaultActivation activation = named(dds::FaultActivation{});
  activation.sequence = 1;
  activation.fault_id = "of another scenario";
  activations.Write(activation);
  dds::TraceRows row = named(dds::TraceRows{});
  row.column_count = static_cast<std::int64_t>(TraceLayout(Model().signals(), scenario).columns.size());
  row.values.assign(static_cast<std::size_t>(row.column_count), std::numeric_limits<double>::quiet_NaN());
  row.sequence = 1;
  rows.Write(row);
  row.column_count = -1;
  row.sequence = 2;
  rows.Write(row);
  row.column_count = 0;
  row.sequence = 3;
  rows.Write(row);
  dds::SerialTap tap = named(dds::SerialTap{});
  tap.sequence = 1;
  tap.frames.resize(1);
  tap.frames[0].direction = 3;
  taps.Write(tap);
  dds::NodeReport report = named(dds::NodeReport{});
  report.payload = {1, 2, 3};
  reports.Write(report);
  report.node_id = "link";
  Packer packer;
  packer(NodeTotals());
  report.payload.assign(packer.bytes().begin(), packer.bytes().end());
  report.fault_activation = 2;
  reports.Write(report);
  ASSERT_TRUE(condition_.Wait([&] {
    collector.Drain(flown_ns_);
    return (collector.Missing("link") != "its closing report");
  }));
  // A damaged report is none, and what is missing is named.
  EXPECT_EQ(collector.Missing("plant"), "its closing report");
  EXPECT_EQ(collector.Missing("link"), "fault activations 1 to 2");
  const RunLog log = collector.Take(0);
  EXPECT_THAT(log.activations, IsEmpty());
  EXPECT_EQ(log.trace.row_count(), 0u);
  EXPECT_EQ(log.link.content().size(), kLinkLogMagic.size());
}

}  // namespace
}  // namespace tiltproof::harness
