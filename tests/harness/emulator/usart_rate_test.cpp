// Baud rates from registers, and what a receiver makes of a sender at another rate.
#include "harness/emulator/usart_rate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "harness/emulator/line_sampler.h"
#include "tests/support/uart_waveform.h"

namespace tiltproof::harness {
namespace {

constexpr std::uint32_t kOver8 = 1U << 15, kOneBit = 1U << 11;
constexpr std::int64_t kApb1Hz = 42'000'000, kApb2Hz = 84'000'000;
constexpr double kLineBitNs = 1e9 / 921'600;

TEST(UsartRate, FollowsBrrAndOver8) {
  // RM0090, table 139: 42 MHz, 921.6 kBps: USARTDIV 2.875 by 16, 5.75 by 8; the rate is 913.043 kBps by both.
  EXPECT_NEAR(RateOf(kApb1Hz, 0x2E, 0, 0).Baud(), 913'043.5, 0.1);
  EXPECT_NEAR(RateOf(kApb1Hz, 0x56, kOver8, 0).Baud(), 913'043.5, 0.1);
  EXPECT_NEAR(RateOf(kApb2Hz, 0x2D9, 0, 0).Baud(), 115'226.3, 0.1);
  EXPECT_NEAR(RateOf(kApb2Hz, 0x5B, 0, 0).Baud(), 2 * RateOf(kApb1Hz, 0x5B, 0, 0).Baud(), 1e-6);
  // The highest bit of the fraction is kept cleared when OVER8 is set, and does not count.
  EXPECT_EQ(RateOf(kApb1Hz, 0x5E, kOver8, 0).clocks_per_bit, 46);
  EXPECT_FALSE(RateOf(kApb1Hz, 0, 0, 0).Runs());
}

TEST(UsartRate, TolerancesAreThoseOfTheManual) {
  EXPECT_EQ(RateOf(kApb1Hz, 0x20, 0, 0).tolerance, 0.0375);
  EXPECT_EQ(RateOf(kApb1Hz, 0x2E, 0, 0).tolerance, 0.0333);
  EXPECT_EQ(RateOf(kApb1Hz, 0x50, kOver8, 0).tolerance, 0.025);
  EXPECT_EQ(RateOf(kApb1Hz, 0x56, kOver8, 0).tolerance, 0.02);
  EXPECT_EQ(RateOf(kApb1Hz, 0x2E, 0, kOneBit).tolerance, 0.0388);
}

// All bytes, back to back, through a receiver; -1 for each framing error.
std::vector<int> Sampled(double sender_bit_ns, double receiver_bit_ns, double tolerance,
                         const std::vector<std::uint8_t>& bytes) {
  LineSampler sampler;
  std::vector<int> seen;
  double begin_ns = 1000;
  const auto take = [&](double until_ns) {
    for (const auto& received : sampler.Take(static_cast<TimeNs>(until_ns), receiver_bit_ns, tolerance))
      seen.push_back(received.framing_error ? -1 : received.word);
  };
  for (const std::uint8_t byte : bytes) {
    sampler.Put(static_cast<TimeNs>(begin_ns), byte, sender_bit_ns);
    begin_ns += 10 * sender_bit_ns;
    take(begin_ns);
  }
  take(begin_ns + 100 * receiver_bit_ns);
  return seen;
}

std::vector<std::uint8_t> AllBytes() {
  std::vector<std::uint8_t> bytes;
  for (int byte = 0; byte < 256; ++byte) bytes.push_back(static_cast<std::uint8_t>(byte));
  return bytes;
}

TEST(LineSampler, ASenderWithinTheToleranceIsUnderstood) {
  const auto bytes = AllBytes();
  const std::vector<int> whole(bytes.begin(), bytes.end());
  for (const double tolerance : {0.02, 0.0333, 0.0375})
    for (const double deviation : {-0.98, 0.0, 0.98}) {
      const double sender_bit_ns = kLineBitNs * (1 + deviation * tolerance);
      EXPECT_TRUE(Understands(kLineBitNs, tolerance, sender_bit_ns));
      EXPECT_EQ(Sampled(sender_bit_ns, kLineBitNs, tolerance, bytes), whole) << tolerance << " " << deviation;
    }
}

TEST(LineSampler, ASenderJustBeyondItIsNot) {
  for (const double tolerance : {0.02, 0.0333, 0.0375}) {
    // Too slow: the stop bit is taken for the last data bit, so bytes below 0x80 are hurt.
    EXPECT_EQ(Sampled(kLineBitNs * (1 + 1.01 * tolerance), kLineBitNs, tolerance, {0x7E}),
              std::vector<int>{-1});
    EXPECT_EQ(Sampled(kLineBitNs * (1 + 1.01 * tolerance), kLineBitNs, tolerance, {0xFE}),
              std::vector<int>{0xFE});
    // Too fast: for the next byte's start bit.
    EXPECT_EQ(Sampled(kLineBitNs * (1 - 1.01 * tolerance), kLineBitNs, tolerance, {0xFE, 0xFE}).front(), -1);
    EXPECT_FALSE(Understands(kLineBitNs, tolerance, kLineBitNs * (1 + 1.01 * tolerance)));
  }
}

TEST(LineSampler, HalfTheRateIsTwoBitsForEach) {
  // 0x7E at half the rate: 0 | 0 1 1 1 1 1 1 0 | 1, each twice. The receiver sees 0 | 0 0 0 1 1 1 1 1 | 1 and then, at
  // the last data bit, 0 | 0 1 1 ...
  EXPECT_EQ(Sampled(2 * kLineBitNs, kLineBitNs, kUsualTolerance, {0x7E}), (std::vector<int>{0xF8, 0xFE}));
  // The other way round each sample takes every second bit.
  EXPECT_EQ(Sampled(kLineBitNs, 2 * kLineBitNs, kUsualTolerance, {0xFF}).size(), 0U)
      << "too short for a start bit";
}

// RM0090, sections 30.3.7 (table 142), 30.6.4 and 30.6.5: M, PCE, PS and STOP.
TEST(UsartFormat, FollowsCr1AndCr2) {
  constexpr std::uint32_t kM = 1U << 12, kPce = 1U << 10, kPs = 1U << 9;
  EXPECT_EQ(link::Name(FormatOf(0, 0)), "8N1");
  EXPECT_EQ(link::Name(FormatOf(kM, 0)), "9N1");
  EXPECT_EQ(link::Name(FormatOf(kPce, 0)), "7E1");
  EXPECT_EQ(link::Name(FormatOf(kM | kPce, 2U << 12)), "8E2");
  EXPECT_EQ(link::Name(FormatOf(kM | kPce | kPs, 0)), "8O1");
  EXPECT_EQ(link::Name(FormatOf(kPs, 0)), "8N1");  // without PCE it selects nothing
}

// Every format of a sender with every format of a receiver, at one rate: bit by bit.
TEST(LineSampler, HearsOtherFormatsAsASlowReceiverDoes) {
  const auto bytes = AllBytes();
  for (const UartFormat& sender : AllUartFormats())
    for (const UartFormat& receiver : AllUartFormats()) {
      std::vector<bool> line = {true};
      LineSampler sampler;
      std::vector<LineSampler::Received> heard;
      const auto hear = [&] {
        const auto more =
            sampler.Take(static_cast<TimeNs>(1000 * line.size()), 1000, kUsualTolerance, receiver.ForLink());
        heard.insert(heard.end(), more.begin(), more.end());
      };
      for (const std::uint8_t byte : bytes) {
        sampler.Put(static_cast<TimeNs>(1000 * line.size()), byte, 1000, sender.ForLink());
        const auto levels = Levels(byte, sender);
        line.insert(line.end(), levels.begin(), levels.end());
        hear();
      }
      line.insert(line.end(), 20, true);
      hear();
      std::vector<HeardCharacter> expected;
      const std::size_t length = Levels(0, receiver).size() - static_cast<std::size_t>(receiver.stop_bits);
      for (std::size_t at = 1; at + 20 < line.size(); ++at) {
        if (line[at] || !line[at - 1]) continue;
        expected.push_back(Hear({line.begin() + static_cast<std::ptrdiff_t>(at),
                                 line.begin() + static_cast<std::ptrdiff_t>(at + 12)},
                                receiver));
        at += length;  // its stop bit
      }
      ASSERT_EQ(heard.size(), expected.size());
      int errors_count = 0;
      for (std::size_t i = 0; i < heard.size(); ++i) {
        const std::string which = link::Name(sender.ForLink()) + " " + link::Name(receiver.ForLink());
        ASSERT_EQ(receiver.ForLink().Carried(static_cast<std::uint8_t>(heard[i].word)), expected[i].byte)
            << which;
        ASSERT_EQ(heard[i].parity_error, expected[i].parity_error) << which;
        ASSERT_EQ(heard[i].framing_error, expected[i].framing_error) << which;
        if (heard[i].parity_error || heard[i].framing_error) ++errors_count;
      }
      const bool same = sender.data_bits == receiver.data_bits && sender.parity == receiver.parity;
      if (same) {
        EXPECT_EQ(heard.size(), 256U);
        EXPECT_EQ(errors_count, 0);
      }
    }
}

TEST(LineSampler, AWrongParityBitIsAParityError) {
  LineSampler sampler;
  const link::CharacterFormat even{.parity = link::Parity::kEven};
  sampler.Put(1000, 0x41, 1000, even);
  sampler.Put(12'000, 0x41, 1000, even, true);
  const auto heard = sampler.Take(100'000, 1000, kUsualTolerance, even);
  ASSERT_EQ(heard.size(), 2U);
  EXPECT_EQ(heard[0].word, 0x041);
  EXPECT_FALSE(heard[0].parity_error);
  EXPECT_EQ(heard[1].word, 0x141);  // the parity bit is the highest bit (section 30.6.2)
  EXPECT_TRUE(heard[1].parity_error);
}

}  // namespace
}  // namespace tiltproof::harness
