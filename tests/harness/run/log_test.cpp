// The link log and the audit of a receiving end.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "firmware/messages.h"
#include "harness/run/link_log.h"
#include "harness/run/receiving_end.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/frame.h"

namespace tiltproof::harness {
namespace {

using link::Chunk;
using link::Direction;

Chunk SentFrame(const link::MessageBytes& message) {
  std::array<std::uint8_t, link::FrameBytesMax(link::kMessageBytesMax)> wire;
  const auto frame = link::EncodeFrame(message.span(), wire);
  return {BootTime(), {frame.bytes.begin(), frame.bytes.end()}, link::kNoMessage};
}

Chunk SensorFrame(float x_m) {
  Sensors sensors;
  sensors.x_m = x_m;
  return SentFrame(link::EncodeSensors(sensors));
}

TEST(LinkLog, SurvivesItsFile) {
  LinkLog log;
  log.Append({-50, {0x7E, 1, 2}, {}}, {0, Direction::kReference}, true);
  log.Append({50, {}, {}}, {0, Direction::kToPlant}, false);
  log.Append({150, std::vector<std::uint8_t>(70'000, 9), {}}, {0, Direction::kToClient}, true);
  const LinkLog again(log.content());
  std::size_t offset = 0;
  const auto first = again.Next(offset);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->begin_ns, -50);
  EXPECT_EQ(first->wire.direction, Direction::kReference);
  EXPECT_TRUE(first->delivered);
  EXPECT_THAT(first->bytes, ::testing::ElementsAre(0x7E, 1, 2));
  EXPECT_TRUE(again.Next(offset)->bytes.empty());
  std::size_t long_bytes = 0;
  while (const auto record = again.Next(offset)) long_bytes += record->bytes.size();
  EXPECT_EQ(long_bytes, 70'000U);
}

TEST(LinkLog, RefusesDamagedFilesWithThePlace) {
  LinkLog log;
  log.Append({100, {0x7E, 1, 2}, {}}, {0, Direction::kReference}, true);
  for (std::size_t size = 0; size < log.content().size(); ++size) {
    if (size == kLinkLogMagic.size()) continue;  // an empty log
    EXPECT_THROW(LinkLog({log.content().begin(), log.content().begin() + static_cast<std::ptrdiff_t>(size)}),
                 std::runtime_error)
        << size;
  }
  auto content = log.content();
  content[17] = 3;
  EXPECT_THROW(LinkLog{content}, std::runtime_error);
}

// Sums of its times are numbers.
TEST(LinkLog, RefusesTimesBeyondAnyFlight) {
  for (const TimeNs far : {kNever, kNever / 2 + 1, -kNever, std::numeric_limits<TimeNs>::min()}) {
    LinkLog log;
    log.Append({100, {0x7E}, {}}, {0, Direction::kReference}, true);
    log.Append({far, {0x7E}, {}}, {0, Direction::kReference}, true);
    EXPECT_THAT([&] { LinkLog{log.content()}; }, ::testing::ThrowsMessage<std::runtime_error>(
                                                     "damaged link log: a time beyond any flight at byte 22"))
        << far;
  }
}

TEST(LinkLog, RecordsSayWhoseTheyAre) {
  LinkLog a, b;
  a.Append({100, {1}, {}}, {0, Direction::kToPlant}, false);
  b.Append({50, {2}, {}}, {1, Direction::kToClient}, true);
  a.Append(std::move(b));
  const LinkLog again(a.content());
  std::size_t offset = 0;
  EXPECT_EQ(again.Next(offset)->wire, (WireId{0, Direction::kToPlant}));
  EXPECT_EQ(again.Next(offset)->wire, (WireId{1, Direction::kToClient}));
  EXPECT_FALSE(again.Next(offset));
}

// As the program wrote it when a flight had one client: begin, direction, side, size, bytes.
TEST(LinkLog, ReadsFilesOfTheFirstVersion) {
  std::vector<std::uint8_t> old = {'T', 'P', 'L', 'I', 'N', 'K', '1', '\n'};
  const std::vector<std::uint8_t> records = {0xEB, 0xAC, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 2, 0, 0x7E,
                                             0x41, 5,    0,    0,    0,    0,    0,    0,    0, 2, 1, 0, 0};
  old.insert(old.end(), records.begin(), records.end());
  const LinkLog log(old);
  std::size_t offset = 0;
  const auto first = log.Next(offset);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->begin_ns, -86'805);
  EXPECT_EQ(first->wire, (WireId{0, Direction::kToPlant}));
  EXPECT_FALSE(first->delivered);
  EXPECT_THAT(first->bytes, ::testing::ElementsAre(0x7E, 0x41));
  const auto second = log.Next(offset);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->begin_ns, 5);
  EXPECT_EQ(second->wire.direction, Direction::kReference);
  EXPECT_TRUE(second->delivered && second->bytes.empty());
  EXPECT_FALSE(log.Next(offset));
  for (const std::size_t size : {std::size_t{7}, std::size_t{10}, old.size() - 13, old.size() - 1})
    EXPECT_THROW(LinkLog({old.begin(), old.begin() + static_cast<std::ptrdiff_t>(size)}), std::runtime_error)
        << size;
}

class AuditTest : public ::testing::Test {
 protected:
  void Send(const Chunk& chunk) {
    end_.OnSent(chunk);
    ++sent_count_;
  }
  // Delivers `chunk` as what became of the frame sent last.
  void Deliver(Chunk chunk, BootTime arrival = {}) {
    chunk.number = sent_count_ - 1;
    end_.OnDelivered(chunk);
    end_.Receive(
        {arrival, chunk.bytes, chunk.number}, [](const auto&, const link::Message&) {},
        [](std::string_view) {});
  }
  ReceivingEnd end_{*FindProtocol("paper"), Direction::kToClient, true};
  std::uint64_t sent_count_ = 0;
};

TEST_F(AuditTest, InOrderFramesAreNeitherWrongNorStale) {
  for (const float x : {1.0F, 2.0F, 2.0F, 3.0F}) {
    Send(SensorFrame(x));
    Deliver(SensorFrame(x));
  }
  EXPECT_EQ(end_.counts().frames_sent, 4);
  EXPECT_EQ(end_.counts().frames_accepted, 4);
  EXPECT_EQ(end_.wrong_count(), 0);
  EXPECT_EQ(end_.stale_count(), 0);
  EXPECT_EQ(end_.counts().bytes_corrupted, 0);
}

TEST_F(AuditTest, LateInOrderFramesAreNotStale) {
  Send(SensorFrame(1));
  Send(SensorFrame(2));
  Deliver(SensorFrame(1));
  Deliver(SensorFrame(2));
  EXPECT_EQ(end_.stale_count(), 0);
}

TEST_F(AuditTest, RepeatsAndOvertakenFramesAreStale) {
  Send(SensorFrame(1));
  Send(SensorFrame(2));
  Deliver(SensorFrame(2));
  Deliver(SensorFrame(2));
  Deliver(SensorFrame(1));
  EXPECT_EQ(end_.stale_count(), 2);
  EXPECT_EQ(end_.wrong_count(), 0);
}

TEST_F(AuditTest, AnAcceptedPayloadThatNobodySentIsWrong) {
  Send(SensorFrame(1));
  Deliver(SensorFrame(7));
  EXPECT_EQ(end_.wrong_count(), 1);
  EXPECT_GT(end_.counts().bytes_corrupted, 0);
}

TEST_F(AuditTest, ResyncLastsFromTheRejectionToTheNextAcceptedFrame) {
  const auto broken = [](float x_m) {
    Chunk chunk = SensorFrame(x_m);
    chunk.bytes[10] ^= 0x01;
    return chunk;
  };
  Send(SensorFrame(1));
  Deliver(broken(1), BootTime(1000));
  Send(SensorFrame(2));
  Deliver(broken(2), BootTime(2000));
  Send(SensorFrame(3));
  Deliver(SensorFrame(3), BootTime(5000));
  EXPECT_EQ(end_.counts().frames_rejected, 2);
  EXPECT_EQ(end_.ResyncMax(BootTime(9000)), 4000);
  EXPECT_EQ(end_.counts().bytes_corrupted, 2);
}

TEST_F(AuditTest, ALinkThatNeverResynchronisesIsOpenToTheEnd) {
  Send(SensorFrame(1));
  Chunk broken = SensorFrame(1);
  broken.bytes[10] ^= 0x01;
  Deliver(broken, BootTime(1000));
  EXPECT_EQ(end_.ResyncMax(BootTime(50'000)), 49'000);
}

TEST_F(AuditTest, LostBytesAreNotCorruptedAndInsertedOnesAre) {
  const Chunk whole = SensorFrame(1);
  Chunk head = whole, tail = whole, longer = whole;
  head.bytes.resize(30);
  tail.bytes.erase(tail.bytes.begin(), tail.bytes.begin() + 50);
  longer.bytes.insert(longer.bytes.begin() + 20, {0xAA, 0xAB});
  Send(whole);
  Deliver(head);
  Deliver(tail);
  EXPECT_EQ(end_.counts().bytes_corrupted, 0);
  Deliver(longer);
  EXPECT_EQ(end_.counts().bytes_corrupted, 2);
}

TEST_F(AuditTest, BytesChangedInPlaceAreAllCounted) {
  // A swap of neighbours changes two bytes; the longest common subsequence misses but one of them.
  Chunk sent = SensorFrame(1);
  for (std::size_t i = 0; i < sent.bytes.size(); ++i) sent.bytes[i] = static_cast<std::uint8_t>(i % 2);
  Chunk swapped = sent;
  std::swap(swapped.bytes[10], swapped.bytes[11]);
  Send(sent);
  Deliver(swapped);
  EXPECT_EQ(end_.counts().bytes_corrupted, 2);
  // A value that stands elsewhere in the frame too is still a changed byte.
  Chunk inverted = sent;
  for (std::uint8_t& byte : inverted.bytes) byte ^= 1;
  Send(sent);
  Deliver(inverted);
  EXPECT_EQ(end_.counts().bytes_corrupted, 2 + static_cast<std::int64_t>(sent.bytes.size()));
}

TEST_F(AuditTest, AFrameSentWithAPauseInItIsNotWrong) {
  const Chunk whole = SensorFrame(1);
  Chunk head = whole, tail = whole;
  head.bytes.resize(30);
  tail.bytes.erase(tail.bytes.begin(), tail.bytes.begin() + 30);
  for (const Chunk& part : {head, tail}) {
    Send(part);
    Deliver(part);
  }
  EXPECT_EQ(end_.counts().frames_accepted, 1);
  EXPECT_EQ(end_.wrong_count(), 0);
}

}  // namespace
}  // namespace tiltproof::harness
