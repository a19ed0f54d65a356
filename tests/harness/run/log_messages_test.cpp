// A flight's records over the bus make the log that one process would have kept.
#include "harness/run/realtime/log_messages.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "firmware/messages.h"
#include "harness/dds/domain_slot.h"
#include "harness/run/late_periods.h"
#include "harness/run/line.h"
#include "harness/run/message_receiver.h"
#include "harness/run/plant_server.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/run/by_hand.h"
#include "tests/harness/run/kept_records.h"
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

// One flight, by hand: the client asks every period and sends the hover input 3 ms later. In one process the plant's rows
// know the counters of the line; elsewhere they follow as records (`counters`).
struct ByHand {
  ByHand(const Scenario& scenario_in, RecordSink& of_line, RecordSink& of_plant, bool counters_in)
      : scenario(scenario_in),
        counters(counters_in),
        line_sink(of_line),
        line(scenario, of_line),
        server(scenario, Model(), of_plant) {}

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
    for (; counters && line.origin().known() && line.origin().ToBootTime(next_sample_ns) < now &&
           next_sample_ns <= scenario.duration_ns;
         next_sample_ns += kControlPeriodNs)
      line_sink.Write({next_sample_ns, 0, record::Counters{line.counts()}});
    server.Advance(now, {counters ? LineCounts{} : line.counts()});
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
  bool counters;
  RecordSink& line_sink;
  LocalLine line;
  OriginFinder origin;
  LocalPlantServer server;
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
      for (LogPublisher* publisher : publishers) publisher->Flush();
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
  const VehicleSignals signals = Model().signals();
  LogBuilder builder(scenario, signals);
  ByHand together(scenario, builder, builder, false);
  together.Fly([] {});
  const Origin origin = together.line.origin();
  ASSERT_TRUE(origin.known());
  const BootTime end = origin.ToBootTime(800 * kNsPerMs);
  together.server.WriteTotals();
  together.line.Finish(end);
  const RunLog expected = builder.Take();
  ASSERT_GT(expected.fault_activation_counts.at(0), 3);
  ASSERT_GT(expected.fault_activation_counts.at(1), 3);
  ASSERT_GT(expected.trace.row_count(), 60u);

  LogCollector collector(bus_, circle_, scenario, signals, "run", condition_.Waker());
  LogPublisher plant(bus_, "run", "plant", bus_.participant()), link(bus_, "run", "link", bus_.participant());
  ByHand apart(scenario, link, plant, true);
  apart.Fly([&] {
    apart.server.WriteActivations();
    apart.line.WriteActivations();
    plant.Flush();
    link.Flush();
    collector.Drain(flown_ns_);
  });
  apart.server.WriteTotals();
  apart.line.Finish(end);
  const BootTime t0 = origin.boot_time();
  const BootTime before = t0 - kLatenessReach;  // what ended then has no effect in the flight
  const Lateness of_plant{.spans = {{before - 9, before}, {t0 - 2, t0 + 5}, {t0 + 1, t0 + 9}},
                          .disturbed = {{t0 + 20, t0 + 21}, {before - 5, before - 4}, {t0 - 3, t0 - 1}},
                          .origin = origin};
  of_plant.WriteTo(plant, "a boot 0-1");
  // Without t = 0 it is unknown when that was.
  const Lateness of_link{.spans = {{BootTime(1), BootTime(2)}, {BootTime(8), BootTime(11)}},
                         .stopped = BootTime(9)};
  of_link.WriteTo(link, "a boot 0-1");
  EXPECT_EQ(collector.Missing("link"), "its last records");
  plant.Close();
  link.Close();
  ASSERT_TRUE(Gather(collector, {"plant", "link"}, {&plant, &link})) << collector.Missing("link");
  // Only the harness says that the flight is over.
  collector.log().Write({777, {}, record::End{}});
  const RunLog log = collector.Take();

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
  // A node that does not know t = 0 counts to the end. This is worth something only when the flight never started.
  EXPECT_THAT(log.harness_late,
              ElementsAre(LateSpan{-8, -7}, LateSpan{-2, 5}, LateSpan{-1, 0}, LateSpan{1, 9}));
  EXPECT_THAT(log.board_disturbed, ElementsAre(LateSpan{-3, -1}, LateSpan{20, 21}));
  RunLog counted = log;
  counted.harness_late.insert(counted.harness_late.begin(), LateSpan{-kLatenessReach - 9, -kLatenessReach});
  counted.end_reason = EndReason::kNeverStarted;
  CountLateness(counted, kNsPerMs);
  EXPECT_EQ(counted.harness_late.size(), 5U);
  counted.end_reason = EndReason::kCompleted;
  CountLateness(counted, kNsPerMs);
  EXPECT_EQ(counted.harness_late, log.harness_late);
}

TEST_F(LogMessagesTest, WhatAnotherRunSaysIsNoPartOfThisOne) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher old(bus_, "old run", "plant", bus_.participant()),
      now(bus_, "run", "plant", bus_.participant());
  old.Write({1, {}, record::Event{"old", ""}});
  now.Write({2, {}, record::Event{"new", ""}});
  old.Close();
  now.Close();
  ASSERT_TRUE(Gather(collector, {"plant"}, {&old, &now}));
  const RunLog log = collector.Take();
  ASSERT_EQ(log.events.size(), 1u);
  EXPECT_EQ(log.events[0].kind, "new");
}

// A node that was held up has more to say at once than one message can hold.
TEST_F(LogMessagesTest, ALogOfAnyLengthGoesOut) {
  const Scenario scenario = TroubledScenario();
  const std::size_t columns = TraceLayout(Model().signals(), scenario).columns.size();
  const std::size_t rows = 2 * dds::kPayloadBytesMax / (columns * sizeof(double)) + 1;
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher node(bus_, "run", "node", bus_.participant());
  for (std::size_t row = 0; row < rows; ++row) {
    record::Row of{std::vector<double>(columns, static_cast<double>(row))};
    of.values[0] = ToSeconds(static_cast<TimeNs>(row) * kControlPeriodNs);
    node.Write({static_cast<TimeNs>(row) * kControlPeriodNs, {}, of});
  }
  for (TimeNs i = 0; i < 20'000; ++i) node.Write({i * kControlPeriodNs, 0, record::Counters{}});
  node.Close();
  ASSERT_TRUE(Gather(collector, {"node"}, {&node})) << collector.Missing("node");
  const RunLog taken = collector.Take();
  ASSERT_EQ(taken.trace.row_count(), rows);
  for (std::size_t row = 0; row < rows; ++row) ASSERT_EQ(taken.trace.at(row, 1), static_cast<double>(row));
}

TEST_F(LogMessagesTest, WhatAFirmwareSaysCannotStopItsNode) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher client(bus_, "run", "client", bus_.participant());
  client.Write({kNsPerS, 0, record::FirmwareText{std::string("a\0b", 3)}});
  client.Write({0, {}, record::Event{"node_event", std::string(2 * dds::kTextBytesMax, 'x')}});
  for (int i = 0; i < 3000; ++i) client.Write({0, 0, record::FirmwareText{std::string(1000, 'y')}});
  client.Close();
  ASSERT_TRUE(Gather(collector, {"client"}, {&client})) << collector.Missing("client");
  const RunLog log = collector.Take();
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
  // More than a flight that has just begun may hold, and less than one of 60 s.
  const std::size_t rows = LogCollector::kNodeBytesMax / (sizeof(double) * columns) * 5 / 4;
  for (const TimeNs flown_ns : {TimeNs{0}, 60 * kNsPerS}) {
    flown_ns_ = flown_ns;
    const std::string run = fmt::format("run at {}", flown_ns);
    LogCollector collector(bus_, circle_, scenario, Model().signals(), run, condition_.Waker());
    LogPublisher plant(bus_, run, "plant", bus_.participant()), link(bus_, run, "link", bus_.participant());
    for (std::size_t row = 0; row < rows; ++row) {
      record::Row of{std::vector<double>(columns)};
      of.values[0] = static_cast<double>(row);
      plant.Write({0, {}, of});
    }
    if (flown_ns == 0) {
      ASSERT_TRUE(condition_.Wait([&] {
        plant.Flush();
        collector.Drain(flown_ns_);
        return !collector.overfull().empty();
      }));
    }
    plant.Write({2, {}, record::Event{"after", ""}});
    plant.Close();
    ASSERT_TRUE(Gather(collector, {"plant"}, {&plant})) << collector.Missing("plant");
    link.Write({1, {}, record::Event{"of another node", ""}});
    link.Close();
    ASSERT_TRUE(Gather(collector, {"link"}, {&link})) << collector.Missing("link");
    const std::string overfull = collector.overfull();
    const RunLog log = collector.Take();
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

// Records of a node of another build, or of a node that does not have the scenario.
TEST_F(LogMessagesTest, BadRecordsDoNoHarm) {
  const Scenario scenario = TroubledScenario();
  const std::size_t columns = TraceLayout(Model().signals(), scenario).columns.size();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  LogPublisher plant(bus_, "run", "plant", bus_.participant());
  plant.Write({0, {}, faults::Activation{0, scenario.faults.size(), "", {}, {}}});
  plant.Write({0, {}, record::ActivationCounts{std::vector<std::int64_t>(1000, 1)}});
  plant.Write({0, {}, record::Row{std::vector<double>(columns, nan)}});
  plant.Write({0, {}, record::Row{std::vector<double>(columns, 2.0)}});
  plant.Write({0, {}, record::Row{std::vector<double>(columns, 1.0)}});
  plant.Write({0, {}, record::Row{{}}});
  plant.Write({0, {}, record::Row{std::vector<double>(columns + 1, 3.0)}});
  plant.Write({0, 0, record::Bytes{static_cast<Direction>(3), ByteSide::kSent, {1}}});
  plant.Write({0, 0, record::Bytes{Direction::kToPlant, static_cast<ByteSide>(3), {1}}});
  plant.Write({0, 1, record::Bytes{Direction::kToPlant, ByteSide::kSent, {1}}});
  plant.Write({0, 0, record::Watched{{1}}});
  plant.Write({0, {}, record::PlantEnd{{}, {}, {}, {0, 1}}});
  plant.Write({5, {}, record::End{.reason = EndReason::kFirmwareCrashed}});
  plant.Close();
  ASSERT_TRUE(Gather(collector, {"plant"}, {&plant})) << collector.Missing("plant");
  const RunLog log = collector.Take();
  EXPECT_THAT(log.activations, IsEmpty());
  EXPECT_THAT(log.fault_activation_counts, ElementsAre(1, 1));
  ASSERT_EQ(log.trace.row_count(), 1u);
  EXPECT_EQ(log.trace.at(0, 0), 2.0);
  EXPECT_EQ(log.link.content().size(), kLinkLogMagic.size());
  EXPECT_EQ(log.end_reason, EndReason::kCompleted);
}

// Nothing that cannot be read counts as read, and what is missing is named.
TEST_F(LogMessagesTest, DamagedAndMissingMessagesAreNamed) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  dds::Publisher<dds::Records> records(bus_);
  ASSERT_TRUE(condition_.Wait([&] { return records.MatchedCount() == 1; }));
  records.Write({"run", "plant", 1, true, {1, 2, 3}});
  records.Write({"run", "link", 1, false, {}});
  records.Write({"run", "link", 4, true, {}});
  ASSERT_TRUE(condition_.Wait([&] {
    collector.Drain(flown_ns_);
    return collector.Missing("plant") != "its last records" &&
           collector.Missing("link") != "its last records";
  }));
  EXPECT_EQ(collector.Missing("plant"), "records that this program can read");
  EXPECT_EQ(collector.Missing("link"), "records 2 to 4");
  EXPECT_EQ(collector.Missing("client"), "its last records");
}

// Programs of others read these topics, whose types have not changed.
TEST_F(LogMessagesTest, TheHarnessPublishesTheRecordsOfNodesForOthers) {
  const Scenario scenario = TroubledScenario();
  LogCollector collector(bus_, circle_, scenario, Model().signals(), "run", condition_.Waker());
  dds::Subscriber<dds::SerialTap> taps(bus_, condition_.Waker());
  dds::Subscriber<dds::FaultActivation> activations(bus_, condition_.Waker());
  dds::Subscriber<dds::RunEvent> events(bus_, condition_.Waker());
  ASSERT_TRUE(condition_.Wait([&] {
    return taps.MatchedCount() == 1 && activations.MatchedCount() == 1 && events.MatchedCount() == 1;
  }));
  LogPublisher link(bus_, "run", "link", bus_.participant());
  const std::vector<std::uint8_t> sent{0x7E, 1, 0x7E}, changed{0x7E, 3, 0x7E};
  link.Write({10, 0, record::Bytes{Direction::kToPlant, ByteSide::kSent, sent}});
  link.Write({10, 0, record::Bytes{Direction::kToPlant, ByteSide::kDelivered, changed}});
  link.Write({11, 0, record::Bytes{Direction::kToPlant, ByteSide::kPassedOn, changed}});
  link.Write({12, 0, record::Reply{5}});
  link.Write({13, 0, record::Answer{6}});
  link.Write({10, 0, faults::Activation{10, 0, "1 bit flipped", {{10, sent}}, {{10, changed}}}});
  link.Write({14, {}, record::Event{"kind", "text"}});
  link.Write({15, 0, record::FirmwareText{"line"}});
  link.Close();
  std::vector<dds::SerialTap> tapped;
  std::vector<dds::FaultActivation> activated;
  std::vector<dds::RunEvent> happened;
  const auto take = [](auto& from, auto& to) {
    for (auto& message : from.Take()) to.push_back(std::move(message));
  };
  ASSERT_TRUE(condition_.Wait([&] {
    link.Flush();
    collector.Drain(flown_ns_);
    take(taps, tapped);
    take(activations, activated);
    take(events, happened);
    return !tapped.empty() && !activated.empty() && happened.size() == 2;
  }));
  const dds::SerialTap tap{"run",
                           "link",
                           1,
                           std::vector<dds::TapFrame>{{10, 0, false, sent, dds::Names{"flips"}},
                                                      {10, 0, true, changed, dds::Names{"flips"}}},
                           {5},
                           {6}};
  EXPECT_EQ(tapped, std::vector{tap});
  const dds::FaultActivation activation{"run",        "link",         1, "flips", 10, "1 bit flipped",
                                        {{10, sent}}, {{10, changed}}};
  EXPECT_EQ(activated, std::vector{activation});
  EXPECT_EQ(happened, (std::vector<dds::RunEvent>{{"run", "link", 1, 14, "kind", "text"},
                                                  {"run", "link", 2, 15, "firmware_log", "line"}}));
}

}  // namespace
}  // namespace tiltproof::harness
