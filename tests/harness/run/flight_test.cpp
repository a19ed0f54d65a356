// The rules of time of a flight, byte by byte, with firmware that does just what a test needs.

#include "harness/run/flight.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

#include "firmware/messages.h"
#include "harness/client/firmware_guard.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/frame.h"
#include "tests/harness/run/by_hand.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kStep = 4 * kNsPerMs;
// 4 bytes of id, 2 of check, 2 flags; nothing to escape in either message.
constexpr TimeNs kRequestTime = 8 * 10 * kNsPerS / 921'600;

// Sends `start`, then a request every period, and answers each reply with what `control` returns.
struct TestClient : Client {
  explicit TestClient(ClientHost host_in, link::Dialect dialect_in = link::Dialect::kPaper)
      : host(std::move(host_in)), dialect(dialect_in) {}

  BootTime Start(BootTime now) override {
    if (silent) return BootTime::Never();
    next_request = host.transmit(Uart::kMain, now, FrameOf(link::EncodeStart(dialect, {10, 10, 0, 0})));
    return Grant(next_request > now ? now : next_request, BootTime::Never());
  }
  void Receive(Uart uart, BootTime now, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> /*marks*/) override {
    if (uart == Uart::kReference) {
      reference_arrivals.push_back(now);
      return;
    }
    while (const auto event = decoder.Next(bytes)) {
      if (event->status != link::FrameStatus::kOk) continue;
      if (link::DecodeSensors(event->payload, sensors) == link::MessageStatus::kOk)
        replies.emplace_back(now, sensors);
      if (control) host.transmit(Uart::kMain, now, FrameOf(link::EncodeActuators(dialect, control(sensors))));
    }
  }
  BootTime Grant(BootTime now, BootTime /*horizon*/) override {
    if (on_grant) on_grant(now);
    if (now >= next_request) {
      host.transmit(Uart::kMain, now, FrameOf(link::EncodeReadSensors(dialect)));
      next_request += kControlPeriodNs;
    }
    return wake_always ? now : next_request;
  }
  void Command(const std::vector<faults::DeviceCommand>& /*commands*/, Origin /*origin*/) override {}
  BootTime Add(const std::vector<faults::DeviceCommand>& /*commands*/) override { return BootTime::Never(); }
  std::optional<ClientStatus> Status() override { return ClientStatus{0, 3}; }
  ClientSample Sample() override { return {}; }

  ClientHost host;
  link::Dialect dialect;
  bool silent = false;
  bool wake_always = false;
  BootTime next_request;
  link::FrameDecoder decoder;
  Sensors sensors;
  std::function<Actuators(const Sensors&)> control;
  std::function<void(BootTime)> on_grant;
  std::vector<std::pair<BootTime, Sensors>> replies;
  std::vector<BootTime> reference_arrivals;
};

Scenario Hover(double duration_s) {
  Scenario scenario;
  scenario.name = "test";
  scenario.duration_ns = FromSeconds(duration_s);
  scenario.reference.path = HoverReference{{0, 0, 5}, 0};
  scenario.initial_position_m = {0, 0, 5};
  return scenario;
}

RunLog FlyWith(const Scenario& scenario, const std::function<void(TestClient&)>& prepare,
               FlightOptions options = {}) {
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    auto client = std::make_unique<TestClient>(std::move(host), scenario.link.protocol->name == "paper"
                                                                    ? link::Dialect::kPaper
                                                                    : link::Dialect::kProvant);
    prepare(*client);
    return client;
  };
  return Fly(scenario, Model(), options);
}

std::vector<double> Column(const RunLog& log, std::string_view name) {
  const auto column = log.trace.Find(name);
  EXPECT_TRUE(column) << name;
  std::vector<double> values;
  for (std::size_t r = 0; r < log.trace.row_count(); ++r) values.push_back(log.trace.at(r, *column));
  return values;
}

TEST(Flight, LogsOneRowAPeriodUpToAndWithTheLast) {
  const RunLog log = FlyWith(Hover(0.12), [](TestClient& client) {
    client.control = [](const Sensors&) { return Actuators{10.27F, 10.28F, 0, 0}; };
  });
  EXPECT_EQ(log.end_reason, EndReason::kCompleted);
  const auto t = Column(log, "t_s");
  ASSERT_EQ(t.size(), 11U);
  for (std::size_t k = 0; k < t.size(); ++k) EXPECT_DOUBLE_EQ(t[k], 0.012 * static_cast<double>(k));
  EXPECT_EQ(log.clients[0].failsafe_entered_count, 3);
}

TEST(Flight, ARowShowsNothingOfWhatCameAfterIt) {
  // At t = 0 the server has accepted `start` alone; the request arrives 87 us later.
  const RunLog log = FlyWith(Hover(0.048), [](TestClient&) {});
  EXPECT_EQ(Column(log, "to_plant_frames_accepted_count"), (std::vector<double>{1, 2, 3, 4, 5}));
}

// A board: runs ahead up to its horizon, and asks 1 ms after each row.
struct AheadClient : Client {
  explicit AheadClient(ClientHost host_in) : host(std::move(host_in)) {}
  bool RunsOn() const override { return true; }
  BootTime Start(BootTime now) override {
    next_request =
        host.transmit(Uart::kMain, now, FrameOf(link::EncodeStart(link::Dialect::kPaper, {10, 10, 0, 0}))) +
        kNsPerMs;
    return now;
  }
  void Receive(Uart /*uart*/, BootTime /*arrival*/, std::span<const std::uint8_t> /*bytes*/,
               std::span<const faults::ReceiveMark> /*marks*/) override {}
  BootTime Grant(BootTime /*now*/, BootTime horizon) override {
    if (next_request > horizon) return horizon;
    host.transmit(Uart::kMain, next_request, FrameOf(link::EncodeReadSensors(link::Dialect::kPaper)));
    return std::exchange(next_request, next_request + kControlPeriodNs) + kRequestTime;
  }
  void Command(const std::vector<faults::DeviceCommand>& /*commands*/, Origin /*origin*/) override {}
  BootTime Add(const std::vector<faults::DeviceCommand>& /*commands*/) override { return BootTime::Never(); }
  std::optional<ClientStatus> Status() override { return std::nullopt; }
  ClientSample Sample() override { return {}; }

  ClientHost host;
  BootTime next_request;
};

TEST(Flight, ARowShowsNothingOfWhatAClientThatRunsAheadSendsAfterIt) {
  FlightOptions options;
  options.make_client = [](std::size_t /*client*/, ClientHost host) {
    return std::make_unique<AheadClient>(std::move(host));
  };
  const RunLog log = Fly(Hover(0.048), Model(), options);
  EXPECT_EQ(Column(log, "to_plant_frames_sent_count"), (std::vector<double>{1, 2, 3, 4, 5}));
  EXPECT_EQ(Column(log, "to_plant_frames_accepted_count"), (std::vector<double>{1, 2, 3, 4, 5}));
}

TEST(Flight, TheLastRowIsAtDurationOnTheGridOrNot) {
  for (const double duration_s : {0.048, 0.05, 0.052}) {
    const RunLog log = FlyWith(Hover(duration_s), [](TestClient&) {});
    const auto t = Column(log, "t_s");
    ASSERT_EQ(t.size(), duration_s > 0.049 ? 6U : 5U);
    EXPECT_DOUBLE_EQ(t.back(), duration_s);
    EXPECT_EQ(log.end_ns, FromSeconds(duration_s));
  }
}

TEST(Flight, TimeZeroIsTheArrivalOfStartAndRequestsFollowJustAfterTheGrid) {
  std::vector<TimeNs> arrivals;
  const RunLog log = FlyWith(Hover(0.06), [](TestClient&) {});
  ASSERT_GE(log.clients[0].request_times_ns.size(), 5U);
  for (std::size_t k = 0; k < 5; ++k)
    EXPECT_NEAR(static_cast<double>(log.clients[0].request_times_ns[k]),
                static_cast<double>(kRequestTime + static_cast<TimeNs>(k) * kControlPeriodNs), 1.0);
  std::size_t offset = 0;
  EXPECT_EQ(log.link.Next(offset)->begin_ns, -kRequestTime) << "the start frame itself has negative time";
}

TEST(Flight, OnTheWireAnInputTakesForceAtTheNextStepBoundary) {
  // Step duration 4 ms: u(0) is accepted some 1.1 ms after t = 0 and holds from 4 ms; the row at 12 ms shows
  // it, the row at 0 does not.
  int call = 0;
  const RunLog log = FlyWith(Hover(0.048), [&](TestClient& client) {
    client.control = [&](const Sensors&) { return Actuators{11.0F + static_cast<float>(call++), 10, 0, 0}; };
  });
  const auto f = Column(log, "f_r_n");
  EXPECT_NEAR(f[0], Model().HoverInput().at(0), 1e-12);
  EXPECT_EQ(f[1], 11.0);
  EXPECT_EQ(f[2], 12.0);
  ASSERT_FALSE(log.clients[0].actuator_times_ns.empty());
  EXPECT_LT(log.clients[0].actuator_times_ns[0], kStep);
}

TEST(Flight, OnTheIdealLinkAnInputIsInForceFromItsOwnSample) {
  Scenario scenario = Hover(0.048);
  scenario.link.ideal = true;
  int call = 0;
  const RunLog log = FlyWith(scenario, [&](TestClient& client) {
    client.control = [&](const Sensors&) { return Actuators{11.0F + static_cast<float>(call++), 10, 0, 0}; };
  });
  const auto f = Column(log, "f_r_n");
  for (std::size_t k = 0; k < f.size(); ++k) EXPECT_EQ(f[k], 11.0 + static_cast<double>(k)) << k;
  for (std::size_t k = 0; k < log.clients[0].request_times_ns.size(); ++k)
    EXPECT_EQ(log.clients[0].request_times_ns[k], static_cast<TimeNs>(k) * kControlPeriodNs);
}

TEST(Flight, SensorsAreTheStateAtTheLastBoundaryBeforeTheRequest) {
  // Free fall: z(t) tells the time of the sample. Requests arrive 0.087 ms after the grid.
  std::vector<std::pair<BootTime, Sensors>> replies;
  TestClient* client_seen = nullptr;
  Scenario scenario = Hover(0.12);
  const RunLog log = FlyWith(scenario, [&](TestClient& client) {
    client_seen = &client;
    client.control = [&](const Sensors& sensors) {
      replies = client_seen->replies;
      (void)sensors;
      return Actuators{0, 0, 0, 0};
    };
  });
  const auto z = Column(log, "z_m");
  ASSERT_GE(replies.size(), 8U);
  for (std::size_t k = 0; k < replies.size(); ++k)
    EXPECT_EQ(replies[k].second.z_m, static_cast<float>(z[k])) << k;
}

TEST(Flight, TheReferenceArrivesBeforeTheSensorReplyOfItsPeriod) {
  for (const bool ideal : {false, true}) {
    Scenario scenario = Hover(0.12);
    scenario.link.ideal = ideal;
    std::vector<std::pair<std::size_t, std::size_t>> counts;
    FlyWith(scenario, [&](TestClient& client) {
      client.control = [&](const Sensors&) {
        counts.emplace_back(client.replies.size(), client.reference_arrivals.size());
        return Actuators{10, 10, 0, 0};
      };
    });
    ASSERT_GE(counts.size(), 9U);
    for (const auto& [replies, references] : counts) EXPECT_GE(references, replies) << "ideal " << ideal;
  }
}

TEST(Flight, LateRepliesHaveTheirOwnLatency) {
  Scenario scenario = Hover(0.5);
  faults::FaultSpec late;
  late.id = "late";
  late.type = "frame.delay";
  late.target = faults::Target::kToClient;
  late.parameters = {{"mean_ms", 30.0}};
  scenario.faults.push_back(late);
  // Falling, so that no two replies say the same.
  const RunLog log = FlyWith(scenario, [](TestClient& client) {
    client.control = [](const Sensors&) { return Actuators{5, 5, 0, 0}; };
  });
  ASSERT_GT(log.clients[0].reply_latency_ns.size(), 30U);
  for (const TimeNs latency : log.clients[0].reply_latency_ns) {
    EXPECT_GT(latency, 30 * kNsPerMs);
    EXPECT_LT(latency, 32 * kNsPerMs);
  }
}

// Arrivals of the frames of a direction that went on, in order, from what the log says of their bytes.
std::vector<TimeNs> DeliveredArrivals(const RunLog& log, link::Direction direction) {
  std::vector<TimeNs> arrivals;
  std::size_t offset = 0;
  while (const auto record = log.link.Next(offset))
    if (record->delivered && record->wire.direction == direction)
      arrivals.push_back(record->begin_ns +
                         link::BytesTime(921'600, static_cast<std::int64_t>(record->bytes.size())));
  return arrivals;
}

TEST(Flight, EqualRepliesInFlightHaveEachItsOwnLatency) {
  // All sensors are frozen, so that all replies say the same, and three are on their way at any time.
  Scenario scenario = Hover(0.5);
  faults::FaultSpec late;
  late.id = "late";
  late.type = "frame.delay";
  late.target = faults::Target::kToClient;
  late.parameters = {{"mean_ms", 30.0}};
  scenario.faults.push_back(late);
  for (const auto& field : kSensorFields) {
    faults::FaultSpec frozen;
    frozen.id = field.column;
    frozen.type = "sensor.freeze";
    frozen.parameters = {{"signal", std::string(field.column)}};
    scenario.faults.push_back(frozen);
  }
  std::vector<Sensors> replies;
  const RunLog log = FlyWith(scenario, [&](TestClient& client) {
    client.control = [&](const Sensors& sensors) {
      replies.push_back(sensors);
      return Actuators{std::nanf(""), 0, 0, 0};  // which the server does not accept
    };
  });
  ASSERT_GT(replies.size(), 30U);
  for (const Sensors& reply : replies) ASSERT_EQ(reply, replies.front());
  ASSERT_EQ(log.clients[0].reply_latency_ns.size(), replies.size());
  const auto arrivals = DeliveredArrivals(log, link::Direction::kToClient);
  for (std::size_t i = 0; i < replies.size(); ++i)
    EXPECT_EQ(log.clients[0].reply_latency_ns[i], arrivals[i] - log.clients[0].request_times_ns[i]);
}

TEST(Flight, ARepeatedRequestHasARepliesLatencyOfItsOwn) {
  Scenario scenario = Hover(0.12);
  faults::FaultSpec twice;
  twice.id = "twice";
  twice.type = "frame.duplicate";
  twice.target = faults::Target::kToPlant;
  twice.message = "request";
  twice.parameters = {{"probability", 1.0}};
  scenario.faults.push_back(twice);
  const RunLog log = FlyWith(scenario, [](TestClient&) {});
  const auto arrivals = DeliveredArrivals(log, link::Direction::kToClient);
  ASSERT_GE(log.clients[0].reply_latency_ns.size(), 18U);
  // The second of two equal replies waits until the line has carried the first.
  for (std::size_t i = 0; i < log.clients[0].reply_latency_ns.size(); ++i)
    EXPECT_EQ(log.clients[0].reply_latency_ns[i], arrivals[i] - log.clients[0].request_times_ns[i]) << i;
}

faults::FaultSpec OnReplies(const std::string& type, double probability) {
  faults::FaultSpec fault;
  fault.id = "fault";
  fault.type = type;
  fault.target = faults::Target::kToClient;
  fault.start_ns = 100 * kNsPerMs;  // when the vehicle has begun to move
  fault.parameters = {{"probability", probability}};
  return fault;
}

TEST(Flight, LostRepeatedAndOvertakenRepliesChangeNoOthersLatency) {
  for (const char* type : {"frame.drop", "frame.duplicate", "frame.reorder"}) {
    Scenario scenario = Hover(2.0);
    scenario.faults = {OnReplies(type, 0.3)};
    if (scenario.faults[0].type == "frame.reorder") scenario.faults[0].parameters["depth_count"] = 2.0;
    // Falling a little, so that no two replies say the same: what one says tells which request it answers.
    std::vector<std::pair<BootTime, float>> heard;
    const RunLog log = FlyWith(scenario, [&](TestClient& client) {
      client.control = [&](const Sensors& sensors) {
        heard.emplace_back(client.replies.back().first, sensors.z_m);
        return Actuators{9.5, 9.5, 0, 0};
      };
    });
    std::map<float, TimeNs> requested;  // by what the reply says
    std::size_t offset = 0;
    while (const auto record = log.link.Next(offset)) {
      if (record->delivered || record->wire.direction != link::Direction::kToClient) continue;
      link::FrameDecoder decoder;
      std::span<const std::uint8_t> bytes = record->bytes;
      Sensors sensors;
      while (const auto event = decoder.Next(bytes)) link::DecodeSensors(event->payload, sensors);
      requested.emplace(sensors.z_m, log.clients[0].request_times_ns.at(requested.size()));
    }
    ASSERT_EQ(requested.size(), log.clients[0].request_times_ns.size()) << type;
    // The first copy of a repeated reply counts. The client counts time from its power-on.
    const Origin origin(heard.front().first - requested.at(heard.front().second) -
                        log.clients[0].reply_latency_ns.front());
    std::vector<TimeNs> latencies;
    for (const auto& [now, z_m] : heard) {
      const auto request = requested.find(z_m);
      if (request == requested.end()) continue;
      latencies.push_back(origin.SimulationTime(now) - request->second);
      requested.erase(request);
    }
    EXPECT_EQ(log.clients[0].reply_latency_ns, latencies) << type;
  }
}

TEST(Flight, AnOlderReplyInThePlaceOfANewOneIsNotTheNewOnesAnswer) {
  Scenario scenario = Hover(2.0);
  scenario.faults = {OnReplies("frame.replay_stale", 0.3)};
  scenario.faults[0].parameters["age_count"] = 2.0;
  const RunLog log = FlyWith(scenario, [](TestClient& client) {
    client.control = [](const Sensors&) { return Actuators{9.5, 9.5, 0, 0}; };
  });
  std::array<std::vector<std::vector<std::uint8_t>>, 2> frames;  // as sent, as they went on
  std::size_t offset = 0;
  while (const auto record = log.link.Next(offset))
    if (record->wire.direction == link::Direction::kToClient)
      frames[record->delivered ? 1 : 0].emplace_back(record->bytes.begin(), record->bytes.end());
  const auto arrivals = DeliveredArrivals(log, link::Direction::kToClient);
  std::vector<TimeNs> latencies;
  for (std::size_t i = 0; i < frames[0].size(); ++i)
    if (frames[0][i] == frames[1][i]) latencies.push_back(arrivals[i] - log.clients[0].request_times_ns[i]);
  EXPECT_LT(latencies.size(), frames[0].size());
  EXPECT_EQ(log.clients[0].reply_latency_ns, latencies);
}

TEST(Flight, AReplyThatTheNextFramesFlagClosesHasItsLatencyToThere) {
  // Cut short by its closing flag alone, a reply is whole when the next one begins.
  Scenario scenario = Hover(2.0);
  scenario.faults = {OnReplies("wire.byte_drop", 0.01)};
  const RunLog log = FlyWith(scenario, [](TestClient& client) {
    client.control = [](const Sensors&) { return Actuators{9.5, 9.5, 0, 0}; };
  });
  std::vector<std::vector<std::uint8_t>> sent;
  std::size_t offset = 0, closed_late_count = 0, at = 0;
  std::vector<TimeNs> latencies;
  while (const auto record = log.link.Next(offset)) {
    if (record->wire.direction != link::Direction::kToClient) continue;
    if (!record->delivered) {
      sent.emplace_back(record->bytes.begin(), record->bytes.end());
      continue;
    }
    ASSERT_EQ(++at, sent.size()) << "no reply vanished: the test needs other probabilities";
    const std::vector<std::uint8_t> bytes(record->bytes.begin(), record->bytes.end());
    if (bytes.size() + 1 == sent.back().size() &&
        std::equal(bytes.begin(), bytes.end(), sent.back().begin())) {
      const TimeNs next_flag = log.clients[0].request_times_ns.at(at) + link::BytesTime(921'600, 1);
      latencies.push_back(next_flag - log.clients[0].request_times_ns[at - 1]);
      ++closed_late_count;
    } else if (bytes.size() >= sent.back().size() - 1 &&
               std::equal(bytes.rbegin(), bytes.rbegin() + 66, sent.back().rbegin())) {
      // Whole, or without its opening flag: the line is idle before it.
      latencies.push_back(record->begin_ns +
                          link::BytesTime(921'600, static_cast<std::int64_t>(bytes.size())) -
                          log.clients[0].request_times_ns[at - 1]);
    }
  }
  EXPECT_GT(closed_late_count, 0U);
  EXPECT_EQ(log.clients[0].reply_latency_ns, latencies);
}

TEST(Flight, AFirmwareThatNeverStartsFails) {
  const RunLog log = FlyWith(Hover(1), [](TestClient& client) { client.silent = true; });
  EXPECT_EQ(log.end_reason, EndReason::kNeverStarted);
  EXPECT_EQ(log.trace.row_count(), 0U);
}

TEST(Flight, AFirmwareThatLetsNoTimePassIsHung) {
  const RunLog log = FlyWith(Hover(1), [](TestClient& client) { client.wake_always = true; });
  EXPECT_EQ(log.end_reason, EndReason::kFirmwareHung);
  EXPECT_THAT(log.end_text, HasSubstr("lets no time pass"));
}

TEST(Flight, TroubleInTheFirmwareKeepsWhatWasFlown) {
  const RunLog log = FlyWith(Hover(1), [](TestClient& client) {
    client.on_grant = [](BootTime now) {
      if (now > BootTime(500 * kNsPerMs)) throw FirmwareTrouble(false, "the firmware crashed: test");
    };
  });
  EXPECT_EQ(log.end_reason, EndReason::kFirmwareCrashed);
  EXPECT_GT(log.trace.row_count(), 40U);
}

TEST(Flight, ARepeatedStartIsARestartInThePapersDialectOnly) {
  for (const auto dialect : {link::Dialect::kPaper, link::Dialect::kProvant}) {
    Scenario scenario = Hover(0.12);
    scenario.link.protocol = FindProtocol(Name(dialect));
    bool repeated = false;
    const RunLog log = FlyWith(scenario, [&](TestClient& client) {
      client.on_grant = [&](BootTime now) {
        if (now < BootTime(50 * kNsPerMs) || repeated) return;
        repeated = true;
        client.host.transmit(Uart::kMain, now, FrameOf(link::EncodeStart(dialect, {10, 10, 0, 0})));
      };
    });
    EXPECT_EQ(log.clients[0].starts_accepted_count, dialect == link::Dialect::kPaper ? 2 : 1);
  }
}

TEST(Flight, LosingThrustEndsOnTheGround) {
  const RunLog log = FlyWith(Hover(5), [](TestClient& client) {
    client.control = [](const Sensors&) { return Actuators{0, 0, 0, 0}; };
  });
  EXPECT_EQ(log.end_reason, EndReason::kGroundStrike);
  // From 5 m: sqrt(2 h / g) is 1.01 s, less the body's own extent.
  EXPECT_GT(ToSeconds(log.end_ns), 0.9);
  EXPECT_LT(ToSeconds(log.end_ns), 1.05);
}

TEST(Flight, AnInterruptKeepsWhatWasFlown) {
  std::atomic<bool> interrupted{false};
  FlightOptions options;
  options.interrupted = &interrupted;
  const RunLog log = FlyWith(
      Hover(10),
      [&](TestClient& client) {
        client.on_grant = [&](BootTime now) { interrupted = now > BootTime(kNsPerS); };
      },
      options);
  EXPECT_EQ(log.end_reason, EndReason::kInterrupted);
  EXPECT_NEAR(ToSeconds(log.end_ns), 1.0, 0.02);
}

TEST(Flight, AdapterLatencyDelaysOnlyWhatTheFirmwareSends) {
  Scenario scenario = Hover(0.06);
  scenario.link.adapter_latency_ms = 2;
  const RunLog log = FlyWith(scenario, [](TestClient&) {});
  // t = 0 is itself the delayed arrival of start, so requests stay where they were; but the client sees its
  // first reply 4 ms after it began.
  ASSERT_FALSE(log.clients[0].request_times_ns.empty());
  EXPECT_NEAR(static_cast<double>(log.clients[0].request_times_ns[0]), static_cast<double>(kRequestTime),
              1.0);
  std::size_t offset = 0;
  EXPECT_EQ(log.link.Next(offset)->begin_ns, -kRequestTime - 2 * kNsPerMs);
}

}  // namespace
}  // namespace tiltproof::harness
