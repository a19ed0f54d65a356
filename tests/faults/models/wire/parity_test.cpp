// Faults of bits on a line with parity, against a slow model of a UART's characters.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"
#include "tests/support/uart_waveform.h"

namespace tiltproof::faults {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::IsEmpty;

FaultSchedule OnLine(const std::vector<FaultSpec>& specs, const UartFormat& uart) {
  return AtTheLine(specs, 1, {.character = uart.ForLink()});
}

link::Chunk Through(FaultSchedule& schedule, link::Chunk chunk) {
  std::vector<link::Chunk> chunks = {std::move(chunk)};
  schedule.Filter(link::Direction::kToClient)->Apply(chunks);
  return chunks.at(0);
}

// 64 characters with parity have as many bits as 72 without: the same draws flip the same places of both.
TEST(ParityTest, FlippedBitsReachTheParityBitAndTheReceiverNoticesAnOddNumber) {
  const std::vector<FaultSpec> specs = {
      Spec("wire.bit_error", {{"ber", 0.03}}),
      Spec("wire.gilbert_elliott",
           {{"p_bad", 0.01}, {"p_good", 0.05}, {"ber_good", 0.001}, {"ber_bad", 0.4}})};
  for (const FaultSpec& spec : specs)
    for (const UartFormat& uart : {UartFormat{8, 'E', 1}, UartFormat{8, 'O', 2}}) {
      FaultSchedule plain = OnLine({spec}, {}), checked = OnLine({spec}, uart);
      plain.SetOrigin(kOriginAtPowerOn);
      checked.SetOrigin(kOriginAtPowerOn);
      int errors_count = 0, hidden_count = 0;
      for (std::int64_t n = 0; n < 300; ++n) {
        const link::Chunk longer = Frame(n, 72), sent = Frame(n, 64);
        std::vector<bool> line;
        const std::size_t length = Levels(0, uart).size();
        for (const std::uint8_t byte : sent.bytes) {
          const auto levels = Levels(byte, uart);
          line.insert(line.end(), levels.begin(), levels.end());
        }
        for (const std::size_t bit : FlippedBits(longer, Through(plain, longer))) {
          const std::size_t at = bit / 9 * length + 1 + bit % 9;
          line[at] = !line[at];
        }
        const link::Chunk received = Through(checked, sent);
        ASSERT_EQ(received.bytes.size(), 64U);
        for (std::size_t i = 0; i < 64; ++i) {
          const auto begin = line.begin() + static_cast<std::ptrdiff_t>(i * length);
          const HeardCharacter heard =
              Hear(std::vector<bool>(begin, begin + static_cast<std::ptrdiff_t>(length)), uart);
          ASSERT_EQ(received.bytes[i], heard.byte);
          ASSERT_EQ(received.HasParityError(i), heard.parity_error);
          if (heard.parity_error) ++errors_count;
          if (!heard.parity_error && heard.byte != sent.bytes[i]) ++hidden_count;
        }
      }
      EXPECT_GT(errors_count, 100);
      EXPECT_GT(hidden_count, 10);  // two flips in a character
    }
}

TEST(ParityTest, StopBitsChangeNoDrawAndNothingIsCheckedWithoutParity) {
  FaultSchedule one = OnLine({Spec("wire.bit_error", {{"ber", 0.02}})}, {8, 'N', 1});
  FaultSchedule two = OnLine({Spec("wire.bit_error", {{"ber", 0.02}})}, {8, 'N', 2});
  one.SetOrigin(kOriginAtPowerOn);
  two.SetOrigin(kOriginAtPowerOn);
  for (std::int64_t n = 0; n < 100; ++n) {
    const link::Chunk received = Through(one, Frame(n));
    EXPECT_EQ(received.bytes, Through(two, Frame(n)).bytes);
    EXPECT_THAT(received.parity_errors, IsEmpty());
  }
}

// Disturbances of one bit hit each of the nine bits of a character alike, and each is an error of parity.
TEST(ParityTest, ADisturbanceOfOneBitIsAlwaysNoticed) {
  FaultSchedule schedule =
      OnLine({Spec("wire.burst", {{"length_bits", 1.0}, {"density", 1.0}, {"rate_hz", 300.0}})}, {8, 'E', 1});
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<bool> on_parity_bit;
  for (std::int64_t n = 0; n < 20'000; ++n) {
    link::Chunk sent = Frame(n);
    sent.begin_ns = BootTime(n * 68 * 11 * kNsPerS / 921'600);
    const link::Chunk received = Through(schedule, sent);
    for (std::size_t i = 0; i < sent.bytes.size(); ++i) {
      const int flips = std::popcount(static_cast<unsigned>(received.bytes[i] ^ sent.bytes[i]));
      if (flips > 1) continue;                                  // of two disturbances
      if (flips == 1 && !received.HasParityError(i)) continue;  // one on the parity bit, too
      if (received.HasParityError(i)) on_parity_bit.push_back(flips == 0);
    }
  }
  EXPECT_GT(on_parity_bit.size(), 4000U);
  EXPECT_TRUE(AreBernoulli(on_parity_bit, 1.0 / 9));
}

// Bytes with an odd value have a parity error: wherever a fault moves them, it follows.
TEST(ParityTest, FaultsThatMoveBytesMoveTheirParityErrors) {
  link::Chunk sent = Frame(3);
  sent.bytes = DistinctBytes();
  for (const std::uint8_t byte : sent.bytes) sent.parity_errors.push_back(byte % 2);
  for (const auto& spec :
       {Spec("wire.byte_drop", {{"probability", 0.3}}), Spec("wire.byte_duplicate", {{"probability", 0.3}}),
        Spec("wire.byte_swap", {{"probability", 0.5}}),
        Spec("wire.chunking", {{"max_bytes_count", 7.0}, {"gap_ms", 0.5}}),
        Spec("wire.baud_mismatch", {{"ppm", 0.0}}), Spec("frame.duplicate", {{"probability", 1.0}})}) {
    FaultSchedule schedule = OnLine({spec}, {8, 'O', 1});
    schedule.SetOrigin(kOriginAtPowerOn);
    std::vector<link::Chunk> out = {sent};
    schedule.Filter(link::Direction::kToClient)->Apply(out);
    std::size_t errors_count = 0;
    for (const link::Chunk& chunk : out)
      for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
        ASSERT_EQ(chunk.HasParityError(i), chunk.bytes[i] % 2 == 1) << spec.type << " " << i;
        if (chunk.HasParityError(i)) ++errors_count;
      }
    EXPECT_GT(errors_count, 20U) << spec.type;
  }
  // Inserted bytes fit their parity bits.
  FaultSchedule schedule = OnLine({Spec("wire.byte_insert", {{"probability", 0.5}})}, {8, 'O', 1});
  schedule.SetOrigin(kOriginAtPowerOn);
  const link::Chunk received = Through(schedule, sent);
  EXPECT_GT(received.bytes.size(), 120U);
  EXPECT_EQ(received.parity_errors.size(), received.bytes.size());
  EXPECT_EQ(std::accumulate(received.parity_errors.begin(), received.parity_errors.end(), 0), 50);
}

TEST(ParityTest, ALowLineReadsAsZeroWhichFitsEvenParityOnly) {
  for (const UartFormat& uart : {UartFormat{8, 'E', 1}, UartFormat{8, 'O', 1}}) {
    const bool wrong = Hear(std::vector<bool>(Levels(0, uart).size(), false), uart).parity_error;
    FaultSpec spec = Spec("wire.stuck_at", {{"level", std::string("low")}});
    spec.start_ns = FrameTime(1);
    spec.end_ns = FrameTime(2);
    FaultSchedule schedule = OnLine({spec}, uart);
    schedule.SetOrigin(kOriginAtPowerOn);
    const link::Chunk received = Through(schedule, Frame(1));
    EXPECT_THAT(received.bytes, Each(0));
    for (std::size_t i = 0; i < received.bytes.size(); ++i) ASSERT_EQ(received.HasParityError(i), wrong);
  }
}

TEST(ParityTest, TheReceiverMarksAParityErrorUnlessAFaultOfItsOwnPicksTheByte) {
  FaultSchedule none = OnLine({}, {8, 'E', 1});
  std::vector<ReceiveMark> marks;
  none.MarkReceived(link::Direction::kToClient, BootTime(kNsPerS), Bytes{1, 2, 3}, marks, Bytes{0, 1, 0});
  EXPECT_THAT(marks, ElementsAre(ReceiveMark::kNone, ReceiveMark::kParity, ReceiveMark::kNone));
  FaultSchedule lossy = OnLine({Spec("uart.overrun", {{"probability", 1.0}})}, {8, 'E', 1});
  lossy.SetOrigin(kOriginAtPowerOn);
  lossy.MarkReceived(link::Direction::kToClient, BootTime(kNsPerS), Bytes{1, 2}, marks, Bytes{0, 1});
  EXPECT_THAT(marks, Each(ReceiveMark::kOverrun));
}

}  // namespace
}  // namespace tiltproof::faults
