// The log that a stream of records makes, whatever the order in which the parts of a flight write.
#include "harness/run/log_builder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "firmware/messages.h"
#include "tests/harness/run/by_hand.h"
#include "tests/harness/run/kept_records.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using ::testing::ElementsAre;

Scenario OfTwoClients() {
  Scenario scenario;
  scenario.duration_ns = kNsPerS;
  scenario.clients = {{.id = "a", .firmware = ""}, {.id = "b", .firmware = ""}};
  scenario.watch = {"gain"};
  return scenario;
}

double At(const RunLog& log, std::size_t row, const std::string& column) {
  const auto found = log.trace.Find(column);
  EXPECT_TRUE(found) << column;
  return found ? log.trace.at(row, *found) : std::nan("");
}

// As from two link nodes, two client nodes and a plant node, each of which sends what it has in one go.
TEST(LogBuilder, RecordsOfSeveralClientsBecomeThatClientsLog) {
  const Scenario scenario = OfTwoClients();
  const VehicleSignals signals = Model().signals();
  const std::size_t columns = TraceLayout(signals, scenario).columns.size();
  KeptRecords observed;
  LogBuilder builder(scenario, signals, &observed);
  for (const std::size_t client : {1U, 0U}) {
    const auto count = static_cast<std::int64_t>(client + 1);
    for (TimeNs period = 0; period < 3; ++period) {
      record::Counters counters;
      counters.counts[1].frames_accepted = 10 * count + period;
      builder.Write({period * kControlPeriodNs, client, counters});
    }
    builder.Write({kControlPeriodNs, client, record::Watched{{0.5 * static_cast<double>(count)}}});
    builder.Write({0, client, record::State{static_cast<std::uint32_t>(count)}});
    builder.Write({5, client, record::Bytes{Direction::kToPlant, ByteSide::kSent, {7}}});
    builder.Write({6, client, record::FirmwareText{"line of " + scenario.client_id(client)}});
    builder.Write({7, client, record::Accepted{record::AcceptedKind::kRequest}});
    builder.Write({8 - count, client, record::Event{"event", scenario.client_id(client)}});
    builder.Write({9, client, record::LineEnd{.counts = {}, .accepted_wrong_count = count}});
  }
  for (TimeNs period = 0; period < 3; ++period) {
    record::Row row{std::vector<double>(columns, 0.0)};
    row.values[0] = ToSeconds(period * kControlPeriodNs);
    builder.Write({period * kControlPeriodNs, {}, row});
  }
  builder.Write({0, 2, record::Event{"of a client that there is not", ""}});
  builder.Write({kNsPerS, {}, record::End{.reason = EndReason::kGroundStrike, .text = "struck"}});
  const std::size_t written = observed.all.size();
  const RunLog log = builder.Take();

  EXPECT_EQ(written, 2U * 10 + 3 + 1);  // and not that of the third client
  ASSERT_EQ(log.clients.size(), 2U);
  for (const std::size_t client : {0U, 1U}) {
    const auto count = static_cast<double>(client + 1);
    const std::string& id = scenario.client_id(client);
    EXPECT_EQ(log.clients[client].id, id);
    EXPECT_EQ(log.clients[client].firmware_log, "0.000000 line of " + id + "\n");
    EXPECT_THAT(log.clients[client].request_times_ns, ElementsAre(7));
    EXPECT_EQ(log.clients[client].accepted_wrong_count, static_cast<std::int64_t>(client + 1));
    for (std::size_t row = 0; row < 3; ++row)
      EXPECT_EQ(At(log, row, "to_client_" + id + "_frames_accepted_count"),
                10 * count + static_cast<double>(row));
    EXPECT_EQ(At(log, 1, "watch_" + id + "_gain"), 0.5 * count);
    EXPECT_EQ(At(log, 2, "supervisor_state_" + id), count);
  }
  std::size_t offset = 0;
  EXPECT_EQ(log.link.Next(offset)->wire, (WireId{0, Direction::kToPlant}));
  EXPECT_EQ(log.link.Next(offset)->wire, (WireId{1, Direction::kToPlant}));
  EXPECT_FALSE(log.link.Next(offset));
  ASSERT_EQ(log.events.size(), 2U);
  EXPECT_EQ(log.events[0].text, "b");
  EXPECT_EQ(log.events[0].client, 1U);
  EXPECT_EQ(log.events[1].text, "a");
  EXPECT_EQ(log.end_reason, EndReason::kGroundStrike);
  EXPECT_EQ(log.end_ns, kNsPerS);
}

// Lateness on the firmware's host is the firmware's while it has the processors to itself.
TEST(LogBuilder, LeavesOutWhatItsReaderDoesNotNeed) {
  const Scenario scenario;
  const VehicleSignals signals = Model().signals();
  const std::size_t columns = TraceLayout(signals, scenario).columns.size();
  for (const bool whole : {true, false}) {
    LogBuilder builder(scenario, signals, nullptr, {.bytes = whole, .states = whole});
    builder.Write({0, 0, record::State{1}});
    builder.Write({5, 0,
                   record::Bytes{Direction::kToPlant, ByteSide::kSent,
                                 FrameOf(link::EncodeReadSensors(link::Dialect::kPaper))}});
    record::Row row{std::vector<double>(columns, 0.0)};
    builder.Write({0, {}, row});
    const RunLog log = builder.Take();
    EXPECT_EQ(log.trace.Find("supervisor_state").has_value(), whole);
    std::size_t offset = 0;
    EXPECT_EQ(log.link.Next(offset).has_value(), whole);
    EXPECT_EQ(log.clients[0].protocol.has_value(), whole);
    EXPECT_THAT(log.clients[0].sent_request_times_ns, ElementsAre(5));
  }
}

TEST(LogBuilder, LatenessIsOfWhoCausedIt) {
  const Scenario scenario;
  const VehicleSignals signals = Model().signals();
  LogBuilder builder(scenario, signals);
  const auto late = [&](TimeNs begin_ms, record::LateKind kind, const std::string& processors) {
    builder.Write({begin_ms * kNsPerMs, {}, record::Late{(begin_ms + 4) * kNsPerMs, kind, processors}});
  };
  for (const TimeNs begin_ms : {2000, 1000}) {
    late(begin_ms, record::LateKind::kNode, "another boot 0-1");
    late(begin_ms + 10, record::LateKind::kNode, "a boot 0-1");
    late(begin_ms + 20, record::LateKind::kBoard, "a boot 0-1");
  }
  FirmwareUse use{.processors = "a boot 0-1", .processors_count = 2};
  const Origin origin{BootTime(kNsPerS)};
  use.Add({origin.ToBootTime(900 * kNsPerMs), origin.ToBootTime(1100 * kNsPerMs), 400 * kNsPerMs, 3});
  builder.Write({0, 0, record::FirmwareTime{use, origin}});
  // Another program, which left the processors to others.
  builder.Write({0, 1, record::FirmwareTime{FirmwareUse{.processors = "a boot 0-1"}, origin}});
  const RunLog log = builder.Take();
  const auto span = [](TimeNs begin_ms) { return LateSpan{begin_ms * kNsPerMs, (begin_ms + 4) * kNsPerMs}; };
  EXPECT_THAT(log.harness_late, ElementsAre(span(1000), span(2000), span(2010)));
  EXPECT_THAT(log.firmware_late, ElementsAre(span(1010)));
  EXPECT_THAT(log.board_disturbed, ElementsAre(span(2020)));
  ASSERT_TRUE(log.firmware_use);
  EXPECT_EQ(log.firmware_use->run_ns, 400 * kNsPerMs);
}

}  // namespace
}  // namespace tiltproof::harness
