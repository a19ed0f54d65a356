// Lines between boards: every byte once, in order, at the time of a formula of its own; and with each fault as the
// catalogue says.
#include "harness/run/board_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "faults/registry.h"
#include "harness/run/flight.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/harness/run/by_hand.h"
#include "tests/harness/run/kept_records.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

using faults::Target;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using ByteTime = std::pair<TimeNs, std::uint8_t>;

Scenario TwoBoards(std::int64_t baud, std::vector<faults::FaultSpec> faults = {}) {
  Scenario scenario;
  scenario.name = "test";
  scenario.duration_ns = kNsPerS;
  scenario.reference.path = HoverReference{{0, 0, 5}, 0};
  scenario.initial_position_m = {0, 0, 5};
  scenario.clients = {{"a", ""}, {"b", ""}};
  scenario.lines = {{"cross", {"a", "b"}, baud, nullptr}};
  scenario.faults = std::move(faults);
  return scenario;
}

faults::FaultSpec OnCross(const std::string& type, Target target,
                          std::map<std::string, faults::ParameterValue> parameters = {}) {
  faults::FaultSpec fault;
  fault.id = "fault";
  fault.type = type;
  fault.line = "cross";
  fault.target = target;
  if (target != Target::kBoth) fault.line_end = target == Target::kToClient ? "a" : "b";
  fault.parameters = std::move(parameters);
  return fault;
}

// The bytes that have arrived at that end, each with its own time.
std::vector<ByteTime> Taken(BoardLine& line, std::size_t end, std::int64_t baud) {
  std::vector<ByteTime> all;
  while (const auto piece = line.TakePiece(end, BootTime(3600 * kNsPerS)))
    for (std::size_t i = 0; i < piece->bytes.size(); ++i) {
      const auto left = static_cast<std::int64_t>(piece->bytes.size() - 1 - i);
      all.emplace_back((piece->arrival_ns - left * 10 * kNsPerS / baud).ns(), piece->bytes[i]);
    }
  return all;
}

// The formula: a byte time is 10 bits; a byte begins when it is given, or when the one before has ended.
struct Expected {
  explicit Expected(std::int64_t baud_in) : baud(baud_in) {}
  void Give(TimeNs now, std::uint8_t byte) {
    // In units of 1 / baud ns, so that nothing is rounded.
    free = std::max(free, now * baud) + 10 * kNsPerS;
    bytes.emplace_back(free / baud, byte);
  }
  std::int64_t baud;
  std::int64_t free = 0;
  std::vector<ByteTime> bytes;
};

RC_GTEST_PROP(BoardLine, BringsEveryByteOnceAtTheFormulasTime, ()) {
  const auto baud = *rc::gen::element<std::int64_t>(1200, 9600, 115'200, 921'600, 10'000'000);
  const Scenario scenario = TwoBoards(baud);
  KeptRecords records;
  BoardLine line(scenario, 0, records);
  std::array<Expected, 2> expected = {Expected(baud), Expected(baud)};
  TimeNs now = 0;
  std::uint8_t next = 0;
  const int writes_count = *rc::gen::inRange(1, 30);
  for (int i = 0; i < writes_count; ++i) {
    now += *rc::gen::inRange<TimeNs>(0, 40 * 10 * kNsPerS / baud);
    const auto end = *rc::gen::inRange<std::size_t>(0, 2);
    std::vector<std::uint8_t> bytes(*rc::gen::inRange<std::size_t>(1, 40));
    for (std::uint8_t& byte : bytes) expected[1 - end].Give(now, byte = next++);
    // However they are split over calls.
    const auto first = *rc::gen::inRange<std::size_t>(0, bytes.size() + 1);
    if (first > 0) line.Transmit(end, BootTime(now), std::span(bytes).first(first));
    if (first < bytes.size()) {
      const BootTime sent = line.Transmit(end, BootTime(now), std::span(bytes).subspan(first));
      RC_ASSERT(std::abs(sent.ns() - expected[1 - end].bytes.back().first) <= 1);
    }
  }
  for (const std::size_t end : {0, 1}) {
    const std::vector<ByteTime> taken = Taken(line, end, baud);
    RC_ASSERT(taken.size() == expected[end].bytes.size());
    for (std::size_t i = 0; i < taken.size(); ++i) {
      RC_ASSERT(taken[i].second == expected[end].bytes[i].second);
      // Whole nanoseconds are counted from the begin of a busy period, and from the last byte here.
      RC_ASSERT(std::abs(taken[i].first - expected[end].bytes[i].first) <= 2);
    }
  }
}

TEST(BoardLine, GivesNoByteBeforeItsTime) {
  const Scenario scenario = TwoBoards(1'000'000);
  KeptRecords records;
  BoardLine line(scenario, 0, records);
  const std::vector<std::uint8_t> bytes = {1, 2, 3};
  line.Transmit(0, BootTime(5000), bytes);
  EXPECT_EQ(line.NextArrival(0), BootTime::Never());
  EXPECT_EQ(line.NextArrival(1), BootTime(35'000));  // the last one: the receiver is woken once
  EXPECT_FALSE(line.TakePiece(1, BootTime(14'999)));
  const auto first = line.TakePiece(1, BootTime(15'000));
  ASSERT_TRUE(first);
  EXPECT_THAT(std::vector(first->bytes.begin(), first->bytes.end()), ElementsAre(1));
  EXPECT_FALSE(line.TakePiece(1, BootTime(24'999)));
  const auto rest = line.TakePiece(1, BootTime(35'000));
  ASSERT_TRUE(rest);
  EXPECT_THAT(std::vector(rest->bytes.begin(), rest->bytes.end()), ElementsAre(2, 3));
}

// 100 writes of 20 bytes in each direction, once a millisecond; what arrives at both ends.
struct Exchange {
  static constexpr std::int64_t kBaud = 921'600;
  static constexpr int kWrites = 100, kBytes = 20;
  explicit Exchange(std::vector<faults::FaultSpec> faults) : scenario(TwoBoards(kBaud, std::move(faults))) {
    BoardLine line(scenario, 0, records);
    line.SetOrigin(Origin(BootTime()));
    for (int i = 0; i < kWrites; ++i)
      for (const std::size_t end : {0, 1}) {
        std::vector<std::uint8_t> bytes(kBytes);
        for (std::uint8_t& byte : bytes) sent[1 - end].push_back(byte = next++);
        line.Transmit(end, BootTime(i * kNsPerMs), bytes);
      }
    for (const std::size_t end : {0, 1})
      for (const ByteTime& byte : Taken(line, end, kBaud)) {
        times[end].push_back(byte.first);
        got[end].push_back(byte.second);
      }
    line.Finish(BootTime(kNsPerS));
    activations_count = records.Of<record::ActivationCounts>().at(0).counts.at(0);
  }
  int ChangedBits(std::size_t end) const {
    int bits = 0;
    for (std::size_t i = 0; i < std::min(sent[end].size(), got[end].size()); ++i)
      bits += __builtin_popcount(sent[end][i] ^ got[end][i]);
    return bits;
  }
  Scenario scenario;
  KeptRecords records;
  std::uint8_t next = 0;
  std::array<std::vector<std::uint8_t>, 2> sent, got;
  std::array<std::vector<TimeNs>, 2> times;
  std::int64_t activations_count = 0;
};

TEST(BoardLineFaults, ActOneWayOrBothWays) {
  const Exchange to_a({OnCross("link.silence", Target::kToClient)});
  EXPECT_THAT(to_a.got[0], IsEmpty());
  EXPECT_EQ(to_a.got[1], to_a.sent[1]);
  EXPECT_EQ(to_a.activations_count, Exchange::kWrites);
  const Exchange to_b({OnCross("link.silence", Target::kToPlant)});
  EXPECT_EQ(to_b.got[0], to_b.sent[0]);
  EXPECT_THAT(to_b.got[1], IsEmpty());
  const Exchange both({OnCross("link.silence", Target::kBoth)});
  EXPECT_THAT(both.got[0], IsEmpty());
  EXPECT_THAT(both.got[1], IsEmpty());
  EXPECT_EQ(both.activations_count, 2 * Exchange::kWrites);
}

TEST(BoardLineFaults, KeepToTheirWindow) {
  faults::FaultSpec silence = OnCross("link.silence", Target::kToPlant);
  silence.start_ns = 30 * kNsPerMs;
  silence.end_ns = 50 * kNsPerMs;
  const Exchange exchange({silence});
  std::vector<std::uint8_t> expected = exchange.sent[1];
  expected.erase(expected.begin() + 30 * Exchange::kBytes, expected.begin() + 50 * Exchange::kBytes);
  EXPECT_EQ(exchange.got[1], expected);
}

// A fault on the line of a client does not act here, nor the other way round.
TEST(BoardLineFaults, AreOfTheirLineOnly) {
  faults::FaultSpec own = OnCross("link.silence", Target::kBoth);
  own.line = own.line_end = "";
  const Exchange exchange({own});
  EXPECT_EQ(exchange.got[0], exchange.sent[0]);
  EXPECT_EQ(exchange.got[1], exchange.sent[1]);
  const Scenario scenario = TwoBoards(Exchange::kBaud, {OnCross("link.silence", Target::kBoth)});
  EXPECT_EQ(ClientFaults(scenario, 0).Filter(link::Direction::kToPlant), nullptr);
}

TEST(BoardLineFaults, FlipBitsAtTheirRate) {
  const Exchange exchange({OnCross("wire.bit_error", Target::kBoth, {{"ber", 0.01}})});
  for (const std::size_t end : {0, 1}) {
    ASSERT_EQ(exchange.got[end].size(), exchange.sent[end].size());
    // Mean and five standard deviations of a binomial distribution: 16 000 bits.
    EXPECT_NEAR(exchange.ChangedBits(end), 160, 5 * 12.6);
  }
  // Each way has draws of its own.
  std::array<std::vector<std::size_t>, 2> places;
  for (const std::size_t end : {0, 1})
    for (std::size_t i = 0; i < exchange.got[end].size(); ++i)
      if (exchange.got[end][i] != exchange.sent[end][i]) places[end].push_back(i);
  EXPECT_NE(places[0], places[1]);
}

TEST(BoardLineFaults, DropInsertAndDoubleBytes) {
  const Exchange drop({OnCross("wire.byte_drop", Target::kToPlant, {{"probability", 1.0}})});
  EXPECT_THAT(drop.got[1], IsEmpty());
  const Exchange twice({OnCross("wire.byte_duplicate", Target::kToPlant, {{"probability", 1.0}})});
  ASSERT_EQ(twice.got[1].size(), 2 * twice.sent[1].size());
  for (std::size_t i = 0; i < twice.got[1].size(); ++i) EXPECT_EQ(twice.got[1][i], twice.sent[1][i / 2]);
  const Exchange insert({OnCross("wire.byte_insert", Target::kToPlant, {{"probability", 1.0}})});
  EXPECT_EQ(insert.got[1].size(), 2 * insert.sent[1].size());
  // Nothing is lost.
  auto at = insert.got[1].begin();
  for (const std::uint8_t byte : insert.sent[1]) {
    at = std::find(at, insert.got[1].end(), byte);
    ASSERT_NE(at, insert.got[1].end());
    ++at;
  }
}

TEST(BoardLineFaults, DelayWhatIsSent) {
  const Exchange clean({OnCross("frame.delay", Target::kToPlant, {{"mean_ms", 0.0}})});
  const Exchange late({OnCross("frame.delay", Target::kToPlant, {{"mean_ms", 2.5}, {"jitter_ms", 0.0}})});
  ASSERT_EQ(late.got[1], late.sent[1]);
  for (std::size_t i = 0; i < late.times[1].size(); ++i)
    EXPECT_LE(std::abs(late.times[1][i] - clean.times[1][i] - 2'500'000), 2);
  EXPECT_EQ(late.times[0], clean.times[0]);
}

TEST(BoardLineFaults, SampleWrongWhenTheRatesDiffer) {
  const Exchange slightly({OnCross("wire.baud_mismatch", Target::kBoth, {{"ppm", 10'000.0}})});
  EXPECT_EQ(slightly.got[1], slightly.sent[1]);
  const Exchange far({OnCross("wire.baud_mismatch", Target::kBoth, {{"ppm", 100'000.0}})});
  EXPECT_NE(far.got[1], far.sent[1]);
  EXPECT_NE(far.got[0], far.sent[0]);
}

TEST(BoardLineFaults, SendBytesBack) {
  const Exchange echo({OnCross("wire.echo", Target::kToPlant, {{"probability", 1.0}})});
  EXPECT_EQ(echo.got[1], echo.sent[1]);
  EXPECT_EQ(echo.got[0].size(), echo.sent[0].size() + echo.sent[1].size());
}

TEST(BoardLineFaults, MarkBytesAtTheReceiver) {
  const Scenario scenario =
      TwoBoards(921'600, {OnCross("uart.framing_error", Target::kBoth, {{"probability", 1.0}})});
  KeptRecords records;
  BoardLine line(scenario, 0, records);
  line.SetOrigin(Origin(BootTime()));
  const std::vector<std::uint8_t> bytes = {1, 2, 3};
  for (const std::size_t end : {0, 1}) {
    line.Transmit(end, BootTime(0), bytes);
    const auto piece = line.TakePiece(1 - end, BootTime(kNsPerS));
    ASSERT_TRUE(piece);
    EXPECT_THAT(std::vector(piece->marks.begin(), piece->marks.end()),
                ::testing::Each(faults::ReceiveMark::kFraming));
  }
}

// Every type that a line without a protocol accepts leaves the line in order: times ascend, and nothing hangs.
TEST(BoardLineFaults, OfEveryTypeKeepTheOrderOfTime) {
  int types_count = 0;
  for (const faults::FaultType& type : faults::FaultTypes()) {
    const bool is_wire = type.IsOneOf<faults::WireKind>();
    if (!is_wire || faults::LineProblem(type, false)) continue;
    ++types_count;
    faults::FaultSpec fault = OnCross(std::string(type.name), Target::kBoth);
    for (const auto& info : type.parameters) fault.parameters.emplace(info.name, info.example);
    if (type.start == faults::Bound::kRequired) fault.start_ns = 0;
    if (type.end == faults::Bound::kRequired) fault.end_ns = 50 * kNsPerMs;
    const Exchange exchange({fault});
    for (const std::size_t end : {0, 1})
      EXPECT_TRUE(std::is_sorted(exchange.times[end].begin(), exchange.times[end].end())) << type.name;
  }
  EXPECT_GE(types_count, 15);
}

TEST(BoardLineFaults, OnFramesNeedAProtocol) {
  const auto problem = [](const char* type, bool has_protocol) {
    return faults::LineProblem(*faults::FindFaultType(type), has_protocol).value_or("");
  };
  EXPECT_THAT(problem("frame.drop", false), HasSubstr("frame.drop acts on whole frames"));
  EXPECT_EQ(problem("frame.drop", true), "");
  EXPECT_EQ(problem("wire.bit_error", false), "");
  EXPECT_EQ(problem("link.silence", false), "");
  EXPECT_EQ(problem("frame.delay", false), "");
}

// With a protocol, bytes that end a frame go on as this frame: faults on frames act.
TEST(BoardLineFaults, DropFramesOfTheNamedProtocol) {
  Scenario scenario = TwoBoards(921'600, {OnCross("frame.drop", Target::kToPlant, {{"probability", 1.0}})});
  scenario.lines[0].protocol = FindProtocol("paper");
  scenario.faults[0].every_nth_count = 2;
  scenario.faults[0].start_ns = 0;
  KeptRecords records;
  BoardLine line(scenario, 0, records);
  line.SetOrigin(Origin(BootTime()));
  const std::vector<std::uint8_t> frame = FrameOf(link::EncodeReadSensors(link::Dialect::kPaper));
  for (int i = 0; i < 10; ++i) line.Transmit(0, BootTime(i * kNsPerMs), frame);
  EXPECT_EQ(Taken(line, 1, 921'600).size(), 5 * frame.size());
}

// Sends `start`, and from 2 ms on a numbered byte string on each of its lines every 3 ms.
struct Talker : Client {
  Talker(ClientHost host_in, std::size_t lines_count_in, TimeNs begin_ns)
      : host(std::move(host_in)), lines_count(lines_count_in), next(begin_ns) {}
  BootTime Start(BootTime now) override {
    host.transmit(Uart::kMain, now, FrameOf(link::EncodeStart(link::Dialect::kPaper, {10, 10, 0, 0})));
    return next;
  }
  void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> /*marks*/) override {
    if (uart >= Uart::kFirstLine) heard[uart].emplace_back(arrival, std::vector(bytes.begin(), bytes.end()));
  }
  BootTime Grant(BootTime now, BootTime /*horizon*/) override {
    if (now < next) return next;
    for (std::size_t line = 0; line < lines_count; ++line) {
      const std::vector<std::uint8_t> bytes = {static_cast<std::uint8_t>(line), count, 0x55};
      said[LineUart(line)].emplace_back(now, bytes);
      host.transmit(LineUart(line), now, bytes);
    }
    // Nothing is connected there.
    EXPECT_EQ(host.transmit(LineUart(lines_count), now, std::vector<std::uint8_t>{1}), now);
    ++count;
    return next = now + 3 * kNsPerMs;
  }
  void Command(const std::vector<faults::DeviceCommand>& /*commands*/, Origin /*origin*/) override {}
  BootTime Add(const std::vector<faults::DeviceCommand>& /*commands*/) override { return BootTime::Never(); }
  std::optional<ClientStatus> Status() override { return std::nullopt; }
  ClientSample Sample() override { return {}; }

  using Talk = std::map<Uart, std::vector<std::pair<BootTime, std::vector<std::uint8_t>>>>;
  ClientHost host;
  std::size_t lines_count;
  BootTime next;
  std::uint8_t count = 0;
  Talk said, heard;
};

struct ThreeFlown {
  explicit ThreeFlown(std::vector<faults::FaultSpec> faults = {})
      : scenario(TwoBoards(921'600, std::move(faults))) {
    scenario.clients.push_back({"c", ""});
    // b's second line is c's first; the ends are not in the order of the clients.
    scenario.lines.push_back({"other", {"c", "b"}, 115'200, nullptr});
    talks.resize(3);
    FlightOptions options;
    options.make_client = [&](std::size_t client, ClientHost host) {
      const std::size_t lines = scenario.line_ends_of(client).size();
      return std::make_unique<Talker>(std::move(host), lines, static_cast<TimeNs>(2 + client) * kNsPerMs);
    };
    options.retire = [&](std::unique_ptr<Client> client) {
      auto* talker = dynamic_cast<Talker*>(client.get());
      talks.at(retired++) = {talker->said, talker->heard};
    };
    log = Fly(scenario, Model(), options);
  }
  Scenario scenario;
  std::vector<std::pair<Talker::Talk, Talker::Talk>> talks;  // said, heard
  std::size_t retired = 0;
  RunLog log;
};

// Said here, heard there, a byte time for each byte later; a client that runs for another reason has got a part.
void ExpectHeard(const Talker::Talk& said, Uart from, const Talker::Talk& heard, Uart to, std::int64_t baud) {
  Expected expected(baud);
  for (const auto& [at, bytes] : said.at(from))
    for (const std::uint8_t byte : bytes) expected.Give(at.ns(), byte);
  std::vector<ByteTime> got;
  for (const auto& [at, bytes] : heard.at(to))
    for (std::size_t i = 0; i < bytes.size(); ++i)
      got.emplace_back(at.ns() - static_cast<std::int64_t>(bytes.size() - 1 - i) * 10 * kNsPerS / baud,
                       bytes[i]);
  ASSERT_GT(got.size(), 900U);
  ASSERT_GE(got.size() + 3, expected.bytes.size());  // the last ones may be on their way
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].second, expected.bytes[i].second);
    EXPECT_LE(std::abs(got[i].first - expected.bytes[i].first), 2);
  }
}

TEST(LinesInFlight, AreTheUartsInTheOrderOfTheFile) {
  const ThreeFlown flown;
  ASSERT_EQ(flown.log.end_reason, EndReason::kCompleted) << flown.log.end_text;
  ASSERT_EQ(flown.retired, 3U);
  const auto& [a, b, c] = std::tie(flown.talks[0], flown.talks[1], flown.talks[2]);
  ExpectHeard(a.first, LineUart(0), b.second, LineUart(0), 921'600);
  ExpectHeard(b.first, LineUart(0), a.second, LineUart(0), 921'600);
  ExpectHeard(b.first, LineUart(1), c.second, LineUart(0), 115'200);
  ExpectHeard(c.first, LineUart(0), b.second, LineUart(1), 115'200);
  EXPECT_EQ(a.second.size(), 1U);
}

TEST(LinesInFlight, AreInTheLogBehindTheClients) {
  const ThreeFlown flown({OnCross("link.silence", Target::kToPlant)});
  std::map<std::pair<std::size_t, link::Direction>, std::array<std::size_t, 2>> bytes;
  std::size_t offset = 0;
  while (const auto record = flown.log.link.Next(offset))
    if (record->wire.client >= 3)
      bytes[{record->wire.client, record->wire.direction}][record->delivered] += record->bytes.size();
  const auto at = [&](std::size_t line, link::Direction direction) { return bytes[{3 + line, direction}]; };
  EXPECT_GT(at(0, link::Direction::kToPlant)[0], 900U);
  EXPECT_EQ(at(0, link::Direction::kToPlant)[1], 0U);
  EXPECT_EQ(at(0, link::Direction::kToClient)[0], at(0, link::Direction::kToClient)[1]);
  EXPECT_GT(at(1, link::Direction::kToPlant)[0], 900U);
  EXPECT_EQ(at(1, link::Direction::kToPlant)[0], at(1, link::Direction::kToPlant)[1]);
  ASSERT_EQ(flown.log.fault_activation_counts.size(), 1U);
  EXPECT_GT(flown.log.fault_activation_counts[0], 300);
  EXPECT_FALSE(flown.log.activations.empty());
}

TEST(LinesInFlight, GiveTheSameBytesInEveryFlight) {
  const std::vector<faults::FaultSpec> faults = {OnCross("wire.bit_error", Target::kBoth, {{"ber", 0.01}})};
  const ThreeFlown once(faults), again(faults);
  EXPECT_EQ(once.log.link.content(), again.log.link.content());
  ASSERT_EQ(once.log.trace.row_count(), again.log.trace.row_count());
  for (std::size_t row = 0; row < once.log.trace.row_count(); ++row)
    EXPECT_EQ(std::memcmp(once.log.trace.row(row).data(), again.log.trace.row(row).data(),
                          once.log.trace.row(row).size_bytes()),
              0);
}

// More bytes than a line holds: the firmware that sends them is to blame, by name.
TEST(LinesInFlight, AreOverfullByTheirSender) {
  struct Flood final : Talker {
    using Talker::Talker;
    BootTime Grant(BootTime now, BootTime horizon) override {
      if (now >= next) host.transmit(LineUart(0), now, std::vector<std::uint8_t>(1 << 20));
      return Talker::Grant(now, horizon);
    }
  };
  const Scenario scenario = TwoBoards(9600);
  FlightOptions options;
  options.make_client = [&](std::size_t client, ClientHost host) -> std::unique_ptr<Client> {
    if (client == 1) return std::make_unique<Flood>(std::move(host), 1, 2 * kNsPerMs);
    return std::make_unique<Talker>(std::move(host), 1, 2 * kNsPerMs);
  };
  const RunLog log = Fly(scenario, Model(), options);
  ASSERT_TRUE(log.clients[1].loss);
  EXPECT_THAT(log.clients[1].loss->text,
              HasSubstr("wait on the line cross to a: more is sent than it carries"));
  EXPECT_FALSE(log.clients[0].loss);
}

}  // namespace
}  // namespace tiltproof::harness
