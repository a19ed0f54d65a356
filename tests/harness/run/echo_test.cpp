// Frames that come back to their sender (wire.echo): when, behind what, and what the line counts of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "harness/run/line.h"
#include "link/frame.h"
#include "tests/harness/run/kept_records.h"
#include "tests/support/origins.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Bytes = std::vector<std::uint8_t>;
using Arrival = std::pair<TimeNs, Bytes>;  // of the last byte

constexpr BootTime kStart(kNsPerS);

class EchoLineTest : public ::testing::Test {
 protected:
  static faults::FaultSpec Echo(faults::Target target) {
    faults::FaultSpec echo;
    echo.id = "echo";
    echo.type = "wire.echo";
    echo.target = target;
    echo.parameters = {{"probability", 1.0}};
    return echo;
  }
  static Scenario With(std::vector<faults::FaultSpec> faults) {
    Scenario scenario;
    scenario.faults = std::move(faults);
    return scenario;
  }
  // Until `until_ns` after kStart, counted from there.
  static std::vector<Arrival> Take(LocalLine& line, Direction direction, TimeNs until_ns) {
    std::vector<Arrival> arrivals;
    while (const auto piece = line.TakePiece(direction, kStart + until_ns))
      arrivals.emplace_back(piece->arrival_ns - kStart, Bytes(piece->bytes.begin(), piece->bytes.end()));
    return arrivals;
  }
  // At 921600 baud, ten bits a byte.
  static TimeNs Took(std::int64_t bytes_count) { return bytes_count * 10 * kNsPerS / 921'600; }

  KeptRecords records_;
  const Bytes frame_{0x7E, 1, 2, 3, 4, 5, 0x7E};
};

TEST_F(EchoLineTest, ArrivesOneFrameTimeAfterTheFrame) {
  LocalLine line(With({Echo(faults::Target::kToPlant)}), records_);
  line.Transmit(Direction::kToPlant, kStart, frame_);
  EXPECT_EQ(line.NextArrival(Direction::kToClient), kStart + 2 * Took(7));
  EXPECT_THAT(Take(line, Direction::kToPlant, kNsPerMs), ElementsAre(Arrival{Took(7), frame_}));
  EXPECT_THAT(Take(line, Direction::kToClient, kNsPerMs), ElementsAre(Arrival{2 * Took(7), frame_}));
  EXPECT_THAT(Take(line, Direction::kToPlant, kNsPerS), IsEmpty());
}

TEST_F(EchoLineTest, WhatIsSentMeanwhileWaitsBehindIt) {
  LocalLine line(With({Echo(faults::Target::kToPlant)}), records_);
  const Bytes reply{0x7E, 9, 9, 9, 0x7E};
  line.Transmit(Direction::kToPlant, kStart, frame_);
  line.Transmit(Direction::kToClient, kStart + Took(7), reply);
  EXPECT_THAT(Take(line, Direction::kToClient, kNsPerMs),
              ElementsAre(Arrival{2 * Took(7), frame_}, Arrival{2 * Took(7) + Took(5), reply}));
}

TEST_F(EchoLineTest, WaitsBehindWhatIsOnTheLine) {
  LocalLine line(With({Echo(faults::Target::kToPlant)}), records_);
  Bytes reply(68, 9);
  reply.front() = reply.back() = 0x7E;
  line.Transmit(Direction::kToClient, kStart, reply);
  line.Transmit(Direction::kToPlant, kStart, frame_);
  EXPECT_THAT(Take(line, Direction::kToClient, kNsPerMs),
              ElementsAre(Arrival{Took(68), reply}, Arrival{Took(68) + Took(7), frame_}));
}

TEST_F(EchoLineTest, DoesNotComeBackAgain) {
  LocalLine line(With({Echo(faults::Target::kBoth)}), records_);
  line.Transmit(Direction::kToPlant, kStart, frame_);
  EXPECT_THAT(Take(line, Direction::kToPlant, kNsPerS / 2), ElementsAre(Arrival{Took(7), frame_}));
  EXPECT_THAT(Take(line, Direction::kToClient, kNsPerS / 2), ElementsAre(Arrival{2 * Took(7), frame_}));
  EXPECT_EQ(line.NextArrival(Direction::kToPlant), BootTime::Never());
  EXPECT_EQ(line.NextArrival(Direction::kToClient), BootTime::Never());
  line.Transmit(Direction::kToClient, kStart + kNsPerS, frame_);
  EXPECT_THAT(Take(line, Direction::kToPlant, 2 * kNsPerS),
              ElementsAre(Arrival{kNsPerS + 2 * Took(7), frame_}));
}

// They are known when the sender has been silent for 20 byte times.
TEST_F(EchoLineTest, BytesThatNoFlagClosesComeBackWhenTheyAreKnown) {
  LocalLine line(With({Echo(faults::Target::kToPlant)}), records_);
  const Bytes open{0x7E, 1, 2};
  line.Transmit(Direction::kToPlant, kStart, open);
  EXPECT_EQ(line.NextArrival(Direction::kToClient), BootTime::Never());
  const TimeNs known_ns = line.NextArrival(Direction::kToPlant) - kStart;
  EXPECT_NEAR(static_cast<double>(known_ns), static_cast<double>(Took(23)), 2.0);
  EXPECT_THAT(Take(line, Direction::kToPlant, known_ns), ElementsAre(Arrival{known_ns, open}));
  EXPECT_THAT(Take(line, Direction::kToClient, kNsPerMs), ElementsAre(Arrival{known_ns + Took(3), open}));
}

TEST_F(EchoLineTest, OnAnIdealLineItArrivesAtOnce) {
  Scenario scenario = With({Echo(faults::Target::kToPlant)});
  scenario.link.ideal = true;
  LocalLine line(scenario, records_);
  line.Transmit(Direction::kToPlant, kStart, frame_);
  EXPECT_THAT(Take(line, Direction::kToClient, 0), ElementsAre(Arrival{0, frame_}));
}

TEST_F(EchoLineTest, CountsAsReceivedBytesThatTheServerDidNotSend) {
  LocalLine line(With({Echo(faults::Target::kToPlant)}), records_);
  line.SetOrigin(kOriginAtPowerOn);
  line.Transmit(Direction::kToPlant, kStart, frame_);
  Take(line, Direction::kToPlant, kNsPerMs);
  Take(line, Direction::kToClient, kNsPerMs);
  const auto& counts = line.counts();
  EXPECT_EQ(counts[static_cast<std::size_t>(Direction::kToPlant)].bytes_corrupted, 0);
  const auto& back = counts[static_cast<std::size_t>(Direction::kToClient)];
  EXPECT_EQ(back.frames_sent, 0);
  EXPECT_EQ(back.bytes_corrupted, 7);
  EXPECT_EQ(back.frames_rejected, 1);
  line.Finish(kStart + kNsPerMs);
  EXPECT_THAT(records_.Of<record::ActivationCounts>().at(0).counts, ElementsAre(1));
  const auto activations = records_.Of<faults::Activation>();
  ASSERT_EQ(activations.size(), 1U);
  EXPECT_EQ(activations[0].what, "7 bytes come back");
  // In link.bin it was delivered to the client, and not sent there.
  std::vector<std::pair<Direction, ByteSide>> records;
  for (const record::Bytes& bytes : records_.Of<record::Bytes>())
    records.emplace_back(bytes.direction, bytes.side);
  EXPECT_THAT(records, ElementsAre(std::pair(Direction::kToPlant, ByteSide::kSent),
                                   std::pair(Direction::kToPlant, ByteSide::kDelivered),
                                   std::pair(Direction::kToClient, ByteSide::kDelivered)));
}

TEST_F(EchoLineTest, AFullLineNamesIt) {
  LocalLine line(With({Echo(faults::Target::kToPlant)}), records_);
  Bytes block(1000, 5);
  block.back() = 0x7E;
  for (int i = 0; !line.overfull() && i < 10'000; ++i) {
    line.Transmit(Direction::kToPlant, kStart + i * Took(1000), block);
    while (line.TakePiece(Direction::kToPlant, kStart + i * Took(1000))) continue;
  }
  ASSERT_TRUE(line.overfull());
  EXPECT_TRUE(line.overfull()->by_faults);
  EXPECT_THAT(line.overfull()->text, HasSubstr("wait on the line to_client: multiplied by 'echo'"));
}

}  // namespace
}  // namespace tiltproof::harness
