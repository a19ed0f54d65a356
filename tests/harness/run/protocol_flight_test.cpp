// Flights over protocols that are none of ours: streams, other axes, scaled integers, numbered messages, several
// actuator messages. The build `lqr` flies them with its own conversions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/library_client.h"
#include "harness/run/client_parameters.h"
#include "harness/run/flight.h"
#include "harness/run/message_binding.h"
#include "harness/run/plant_server.h"
#include "harness/run/protocol_use.h"
#include "harness/score/score.h"
#include "link/cobs_framing.h"
#include "link/length_framing.h"
#include "tests/harness/run/by_hand.h"
#include "tests/harness/run/kept_records.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using link::MessageField;
using link::MessageKind;
using link::NumberType;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

const plant::VehicleModel& Quadrotor() {
  static const plant::VehicleModel model = [] {
    std::vector<std::string> warnings;
    return plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/quadrotor.sdf", {},
                              warnings);
  }();
  return model;
}

MessageField Scaled(const std::string& signal, double max) {
  return {.signal = signal, .min = -max, .max = max, .type = NumberType::kI16, .scale = max / 32'000};
}
MessageField Plain(const std::string& signal) { return {.signal = signal, .min = -1e4, .max = 1e4}; }
MessageField Sequence(NumberType type = NumberType::kU8) {
  return {.signal = "sequence",
          .max = link::LargestNumber(type),
          .type = type,
          .content = link::FieldContent::kSequence};
}
MessageField TimeUs() {
  return {.signal = "time_us",
          .max = link::LargestNumber(NumberType::kU32),
          .type = NumberType::kU32,
          .order = link::ByteOrder::kBig,
          .content = link::FieldContent::kTimeUs};
}
std::optional<link::MessageId> ByteId(std::uint32_t bits) {
  return link::MessageId{.type = NumberType::kU8, .bits = bits};
}
link::MessageType Reference() {
  return link::LayOut({.name = "reference",
                       .kind = MessageKind::kReference,
                       .direction = Direction::kReference,
                       .fields = {Plain("yaw_rad"), Plain("x_m"), Plain("y_m"), Plain("z_m")}});
}
std::vector<std::string> Inputs() {
  std::vector<std::string> names;
  for (const Signal& input : Quadrotor().signals().inputs) names.push_back(input.name);
  return names;
}

// 250 Hz, by the server itself, in NED and FRD: attitude as a quaternion, scaled integers, and two actuator messages.
link::Protocol Stream() {
  link::Protocol protocol;
  protocol.name = "stream";
  protocol.framing = link::MakeCobsFraming(link::CheckKind::kCrc16Ibm3740);
  protocol.control_period_ns = 4 * kNsPerMs;
  protocol.answers_before_start = true;
  protocol.world = link::WorldAxes::kNed;
  protocol.body = link::BodyAxes::kFrd;
  protocol.messages.push_back(
      link::LayOut({.name = "pose",
                    .kind = MessageKind::kReply,
                    .direction = Direction::kToClient,
                    .id = ByteId(1),
                    .period_ns = 4 * kNsPerMs,
                    .fields = {Sequence(), Scaled("x_m", 32), Scaled("y_m", 32), Scaled("z_m", 32),
                               Scaled("quaternion_w", 1), Scaled("quaternion_x", 1),
                               Scaled("quaternion_y", 1), Scaled("quaternion_z", 1)}}));
  protocol.messages.push_back(
      link::LayOut({.name = "rates",
                    .kind = MessageKind::kReply,
                    .direction = Direction::kToClient,
                    .id = ByteId(2),
                    .period_ns = 4 * kNsPerMs,
                    .fields = {TimeUs(), Scaled("vx_m_s", 30), Scaled("vy_m_s", 30), Scaled("vz_m_s", 30),
                               Scaled("wx_rad_s", 30), Scaled("wy_rad_s", 30), Scaled("wz_rad_s", 30)}}));
  const auto share = [](const std::string& name) {
    return MessageField{.signal = name,
                        .max = 1,
                        .type = NumberType::kU16,
                        .scale = 1.0 / 65'000,
                        .as = link::ThrustUnit::kShareOfSpeed};
  };
  const std::vector<std::string> inputs = Inputs();
  for (const std::size_t half : {0U, 1U})
    protocol.messages.push_back(
        link::LayOut({.name = half == 0 ? "front" : "back",
                      .kind = MessageKind::kActuators,
                      .direction = Direction::kToPlant,
                      .id = ByteId(10 + static_cast<std::uint32_t>(half)),
                      .starts = half == 0,
                      .fields = {Sequence(NumberType::kU16), share(inputs.at(2 * half)),
                                 share(inputs.at(2 * half + 1))}}));
  protocol.messages.push_back(Reference());
  return protocol;
}

// A protocol with two requests, a `start`, and the vehicle's own axes.
link::Protocol TwoRequests() {
  link::Protocol protocol;
  protocol.name = "two_requests";
  protocol.framing = link::MakeLengthFraming({.sync = {0xAA, 0x55}}, link::CheckKind::kCrc32IsoHdlc);
  protocol.control_period_ns = 8 * kNsPerMs;
  protocol.repeated_start_is_boot = true;
  const auto add = [&](link::MessageType type) {
    protocol.messages.push_back(link::LayOut(std::move(type)));
  };
  add({.name = "start",
       .kind = MessageKind::kStart,
       .direction = Direction::kToPlant,
       .id = ByteId(0),
       .starts = true});
  for (const auto& [name, id] : {std::pair{"position", 1U}, {"motion", 2U}})
    add({.name = std::string("read_") + name,
         .kind = MessageKind::kRequest,
         .direction = Direction::kToPlant,
         .id = ByteId(id),
         .reply = name,
         .fields = {Sequence()}});
  add({.name = "position",
       .kind = MessageKind::kReply,
       .direction = Direction::kToClient,
       .id = ByteId(1),
       .fields = {Plain("z_m"), Plain("x_m"), Plain("y_m"), Plain("roll_rad"), Plain("pitch_rad"),
                  Plain("yaw_rad")}});
  add({.name = "motion",
       .kind = MessageKind::kReply,
       .direction = Direction::kToClient,
       .id = ByteId(2),
       .fields = {Plain("vx_m_s"), Plain("vy_m_s"), Plain("vz_m_s"), Plain("wx_rad_s"), Plain("wy_rad_s"),
                  Plain("wz_rad_s"), Sequence()}});
  link::MessageType actuators{.name = "actuators",
                              .kind = MessageKind::kActuators,
                              .direction = Direction::kToPlant,
                              .id = ByteId(3)};
  for (const std::string& name : Inputs())
    actuators.fields.push_back({.signal = name, .max = 20, .order = link::ByteOrder::kBig});
  add(actuators);
  protocol.messages.push_back(Reference());
  return protocol;
}

Scenario Hover(link::Protocol protocol) {
  Scenario scenario;
  scenario.name = "hover";
  scenario.firmware = "lqr";
  scenario.duration_ns = 4 * kNsPerS;
  scenario.step_ns = 2 * kNsPerMs;
  scenario.reference.path = HoverReference{{0, 0, 5}, 0.5};
  scenario.initial_position_m = {0.4, -0.3, 5.2};
  scenario.initial_attitude_rad = {0.05, -0.1, 0.2};
  scenario.link.protocol = std::make_shared<const link::Protocol>(std::move(protocol));
  return scenario;
}

RunLog FlyLqr(const Scenario& scenario) {
  return Fly(scenario, Quadrotor(), {.make_client = [&](std::size_t /*client*/, ClientHost host) {
               return LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, "lqr", scenario.link.protocol->name,
                                        std::move(host), nullptr, false,
                                        [&] { return ClientParameters(scenario, Quadrotor()); });
             }});
}

double Last(const RunLog& log, const char* column) {
  return log.trace.at(log.trace.row_count() - 1, *log.trace.Find(column));
}

void ExpectHover(const Scenario& scenario, const RunLog& log) {
  EXPECT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_NEAR(Last(log, "x_m"), 0, 0.1);
  EXPECT_NEAR(Last(log, "y_m"), 0, 0.1);
  EXPECT_NEAR(Last(log, "z_m"), 5, 0.1);
  EXPECT_NEAR(Last(log, "yaw_rad"), 0.5, 0.1);
  for (const DirectionCounts& counts : log.clients[0].counts) EXPECT_EQ(counts.frames_rejected, 0);
  for (const CriterionResult& criterion : ScoreRun(scenario, log).criteria)
    EXPECT_EQ(criterion.verdict, Verdict::kPass) << criterion.name << ": " << criterion.explanation;
}

TEST(ProtocolFlight, LqrFliesAStreamOfScaledIntegersInOtherAxes) {
  for (const AngularRates rates : {AngularRates::kWorld, AngularRates::kBody, AngularRates::kEuler}) {
    Scenario scenario = Hover(Stream());
    scenario.angular_rates = rates;
    const RunLog log = FlyLqr(scenario);
    ExpectHover(scenario, log);
    const ClientLog& own = log.clients[0];
    // Two messages each way in each of 1000 periods, after those before t = 0.
    EXPECT_NEAR(static_cast<double>(own.counts[static_cast<std::size_t>(Direction::kToClient)].frames_sent),
                2002, 4);
    EXPECT_NEAR(
        static_cast<double>(own.counts[static_cast<std::size_t>(Direction::kToPlant)].frames_accepted), 2000,
        4);
    EXPECT_NEAR(static_cast<double>(own.actuator_times_ns.size()), 1000, 2);
    EXPECT_THAT(own.request_times_ns, IsEmpty());
    EXPECT_NEAR(static_cast<double>(own.sent_request_times_ns.size()), 1000, 2);
    EXPECT_NEAR(static_cast<double>(own.client_round_trip_ns.size()), 1000, 4);
    ASSERT_TRUE(own.line_mistakes && own.protocol);
    EXPECT_THAT(*own.line_mistakes, IsEmpty());
    EXPECT_EQ(own.protocol->requests_per_period_max, 1);
    EXPECT_FALSE(own.protocol->replies_ignored);
  }
}

TEST(ProtocolFlight, LqrAsksForItsStatesInTwoParts) {
  const Scenario scenario = Hover(TwoRequests());
  const RunLog log = FlyLqr(scenario);
  ExpectHover(scenario, log);
  EXPECT_NEAR(static_cast<double>(log.clients[0].request_times_ns.size()), 500, 2);
  EXPECT_NEAR(static_cast<double>(log.clients[0].actuator_times_ns.size()), 500, 2);
}

// The same physics in other axes and other units gives the same flight, but for the rounding of numbers on the line.
TEST(ProtocolFlight, AxesAndUnitsChangeNoFlight) {
  const auto fly = [](link::WorldAxes world, link::BodyAxes body, link::ThrustUnit as, AngularRates rates) {
    link::Protocol protocol = TwoRequests();
    protocol.world = world;
    protocol.body = body;
    for (link::MessageType& type : protocol.messages) {
      for (MessageField& field : type.fields) {
        if (field.content != link::FieldContent::kSignal) continue;
        field.type = NumberType::kF64;
        if (type.kind == MessageKind::kActuators) field.as = as;
      }
      type = link::LayOut(type);
    }
    Scenario scenario = Hover(std::move(protocol));
    scenario.angular_rates = rates;
    scenario.link.ideal = true;
    return FlyLqr(scenario);
  };
  for (const AngularRates rates : {AngularRates::kWorld, AngularRates::kBody, AngularRates::kEuler}) {
    const RunLog plain = fly(link::WorldAxes::kEnu, link::BodyAxes::kFlu, link::ThrustUnit::kNewton, rates);
    ASSERT_EQ(plain.end_reason, EndReason::kCompleted);
    for (const auto world : {link::WorldAxes::kEnu, link::WorldAxes::kNed}) {
      for (const auto body : {link::BodyAxes::kFlu, link::BodyAxes::kFrd}) {
        const RunLog other = fly(world, body, link::ThrustUnit::kShareOfSpeed, rates);
        ASSERT_EQ(other.trace.row_count(), plain.trace.row_count());
        for (const char* column : {"x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"})
          EXPECT_NEAR(Last(other, column), Last(plain, column), 1e-5) << column;
      }
    }
  }
}

TEST(ProtocolFlight, ADuplicateIsStaleAndChangesNothing) {
  Scenario scenario = Hover(Stream());
  scenario.link.ideal = true;
  const RunLog whole = FlyLqr(scenario);
  faults::FaultSpec& fault = scenario.faults.emplace_back();
  fault.id = "twice";
  fault.type = "frame.duplicate";
  fault.target = faults::Target::kToPlant;
  fault.start_ns = kNsPerS;
  fault.end_ns = 2 * kNsPerS;
  fault.parameters = {{"probability", 1.0}};
  const RunLog log = FlyLqr(scenario);
  EXPECT_NEAR(static_cast<double>(log.clients[0].counts[0].frames_rejected), 500, 4);
  EXPECT_TRUE(std::ranges::any_of(log.events, [](const RunEvent& event) {
    return event.kind == "rejected" && event.text.find("stale") != std::string::npos;
  }));
  EXPECT_EQ(Last(log, "x_m"), Last(whole, "x_m"));
  EXPECT_EQ(Last(log, "z_m"), Last(whole, "z_m"));
}

TEST(ProtocolFlight, ALawWithoutItsStatesIsFoundBefore) {
  link::Protocol protocol = Stream();
  EXPECT_THAT(StatesNotCarried(protocol, Quadrotor().signals()), IsEmpty());
  std::erase_if(protocol.messages[0].fields, [](const MessageField& field) {
    return field.signal == "quaternion_y" || field.signal == "z_m";
  });
  EXPECT_THAT(StatesNotCarried(protocol, Quadrotor().signals()),
              ElementsAre("z_m", "roll_rad", "pitch_rad", "yaw_rad"));
  protocol.messages[0] = link::LayOut(protocol.messages[0]);
  EXPECT_THROW(FlyLqr(Hover(std::move(protocol))), std::runtime_error);
}

// --- The server alone.

struct SentMessage {
  TimeNs time_ns;
  std::string name;
  friend bool operator==(const SentMessage&, const SentMessage&) = default;
};

class StreamServer {
 public:
  explicit StreamServer(link::Protocol protocol)
      : scenario_(Hover(std::move(protocol))), server_(scenario_, Quadrotor(), records_) {}

  // Sends what is due until `end_ns`, each at its time.
  std::vector<SentMessage> SendUntil(TimeNs end_ns) {
    std::vector<SentMessage> sent;
    while (server_.state().next_send_ns <= BootTime(end_ns)) Send(server_.state().next_send_ns.ns(), sent);
    return sent;
  }
  void Send(TimeNs at_ns, std::vector<SentMessage>& sent) {
    server_.Advance(BootTime(at_ns), AllCounts(1));
    server_.SendOwn(BootTime(at_ns), [&](std::size_t, std::span<const std::uint8_t> frame) {
      const auto reader = scenario_.link.protocol->framing->MakeReader();
      while (const auto read = reader->Next(frame))
        if (read->ok)
          sent.push_back(
              {at_ns, scenario_.link.protocol->Classify(Direction::kToClient, read->payload)->name});
    });
  }
  void Start(TimeNs at_ns) {
    const auto& messages = scenario_.link.protocol->messages;
    const auto start =
        std::ranges::find_if(messages, [](const link::MessageType& type) { return type.starts; });
    server_.Receive(0, BootTime(at_ns), {&*start, std::vector<double>(start->fields.size())}, [](auto) {});
  }
  const PlantServer::State& state() const { return server_.state(); }

 private:
  Scenario scenario_;
  KeptRecords records_;
  LocalPlantServer server_;
};

link::Protocol SlowAndFast() {
  link::Protocol protocol = Stream();
  protocol.messages[0].period_ns = 10 * kNsPerMs;
  return protocol;
}

TEST(Stream, EachMessageHasItsPeriodFromPowerOnInTheOrderOfTheFile) {
  StreamServer server(SlowAndFast());
  EXPECT_THAT(server.SendUntil(9 * kNsPerMs),
              ElementsAre(SentMessage{0, "pose"}, SentMessage{0, "rates"}, SentMessage{4 * kNsPerMs, "rates"},
                          SentMessage{8 * kNsPerMs, "rates"}));
  server.Start(9 * kNsPerMs + 7);
  EXPECT_TRUE(server.state().started());
  // The start shifts nothing.
  EXPECT_THAT(server.SendUntil(20 * kNsPerMs),
              ElementsAre(SentMessage{10 * kNsPerMs, "pose"}, SentMessage{12 * kNsPerMs, "rates"},
                          SentMessage{16 * kNsPerMs, "rates"}, SentMessage{20 * kNsPerMs, "pose"},
                          SentMessage{20 * kNsPerMs, "rates"}));
}

TEST(Stream, WithoutAnswersBeforeItItBeginsWithTheStart) {
  link::Protocol protocol = SlowAndFast();
  protocol.answers_before_start = false;
  protocol.messages[2].kind = MessageKind::kStart;
  StreamServer server(std::move(protocol));
  EXPECT_THAT(server.SendUntil(kNsPerS), IsEmpty());
  server.Start(5 * kNsPerMs);
  EXPECT_THAT(server.SendUntil(10 * kNsPerMs),
              ElementsAre(SentMessage{5 * kNsPerMs, "pose"}, SentMessage{5 * kNsPerMs, "rates"},
                          SentMessage{9 * kNsPerMs, "rates"}));
}

TEST(Stream, TimesThatWereMissedAreLeftOut) {
  StreamServer server(SlowAndFast());
  std::vector<SentMessage> sent;
  server.Send(0, sent);
  sent.clear();
  server.Send(33 * kNsPerMs, sent);
  EXPECT_THAT(sent, ElementsAre(SentMessage{33 * kNsPerMs, "pose"}, SentMessage{33 * kNsPerMs, "rates"}));
  EXPECT_EQ(server.state().next_send_ns, BootTime(36 * kNsPerMs));
}

// A log of commands at these times, in ms, of a flight that ends at `end_ms`.
std::vector<LineMistake> MistakesOf(const std::vector<double>& commands_ms, double end_ms) {
  const link::Protocol protocol = Stream();
  const link::MessageType& front = *protocol.Find("front");
  RunLog log;
  log.end_ns = static_cast<TimeNs>(end_ms * 1e6);
  log.clients[0].starts_accepted_count = 1;
  double number = 0;
  for (const double at_ms : commands_ms) {
    link::LogChunk chunk;
    chunk.begin_ns = static_cast<TimeNs>(at_ms * 1e6);
    chunk.bytes =
        protocol.framing->Encode(protocol.Encode(front, std::vector<double>{number++, 0.5, 0.5}).span());
    log.link.Append(chunk, {0, Direction::kToPlant}, false);
  }
  AddProtocolUse(log, 0, protocol, {.baud = 0});
  return *log.clients[0].line_mistakes;
}

TEST(Stream, AClientCommandsOnceAPeriod) {
  EXPECT_THAT(MistakesOf({0, 4, 8, 12, 16}, 18), IsEmpty());
  const std::vector<LineMistake> missing = MistakesOf({0, 4, 16, 20}, 22);
  ASSERT_EQ(missing.size(), 1U);
  EXPECT_EQ(missing[0].kind, LineMistakeKind::kMissing);
  EXPECT_EQ(missing[0].count, 2);
  EXPECT_EQ(missing[0].time_ns, 8 * kNsPerMs);
  const std::vector<LineMistake> doubled = MistakesOf({0, 4, 5, 8}, 10);
  ASSERT_EQ(doubled.size(), 1U);
  EXPECT_EQ(doubled[0].kind, LineMistakeKind::kDoubled);
  EXPECT_EQ(doubled[0].time_ns, 5 * kNsPerMs);
}

}  // namespace
}  // namespace tiltproof::harness
