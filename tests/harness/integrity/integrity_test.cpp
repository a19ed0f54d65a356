// Residual errors against a receiver that is asked about every damaged frame, against theory, and against a line whose
// bits are wrong one by one.

#include "harness/integrity/integrity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "harness/integrity/binomial.h"
#include "link/cobs_framing.h"
#include "link/length_framing.h"

namespace tiltproof::harness {
namespace {

using Bytes = std::vector<std::uint8_t>;
using link::CheckKind;

std::shared_ptr<const link::Protocol> PaperWith(std::shared_ptr<const link::Framing> framing) {
  const auto protocol = std::make_shared<link::Protocol>(*link::FindProtocol("paper"));
  protocol->framing = std::move(framing);
  return protocol;
}

std::vector<std::shared_ptr<const link::Protocol>> AllFormats() {
  std::vector<std::shared_ptr<const link::Protocol>> all;
  for (int i = 0; i <= static_cast<int>(LastOf(CheckKind())); ++i) {
    const auto check = static_cast<CheckKind>(i);
    all.push_back(PaperWith(link::MakeHdlcFraming(check)));
    all.push_back(PaperWith(link::MakeCobsFraming(check)));
    all.push_back(PaperWith(link::MakeLengthFraming({.sync = {0xAA, 0x55}}, check)));
  }
  return all;
}

std::string TextOf(const link::Protocol& protocol) {
  return std::string(protocol.framing->name()) + " " + std::string(Name(*protocol.framing->check()));
}

// The number of wrong frames that a receiver delivers, of three of which the second one is damaged.
std::int64_t Passed(const link::Framing& framing, const Bytes& payload, const Bytes& damaged) {
  std::int64_t count = 0;
  const auto reader = framing.MakeReader();
  const Bytes intact = framing.Encode(payload);
  Bytes stream = intact;
  stream.insert(stream.end(), damaged.begin(), damaged.end());
  stream.insert(stream.end(), intact.begin(), intact.end());
  std::span<const std::uint8_t> bytes(stream);
  while (const auto reading = reader->Next(bytes))
    count += reading->ok && !std::ranges::equal(reading->payload, payload) ? 1 : 0;
  if (const auto reading = reader->Finish())
    count += reading->ok && !std::ranges::equal(reading->payload, payload) ? 1 : 0;
  return count;
}

// Exact intervals as R's binom.test has them, and the rule of three for no success.
TEST(Binomial, IntervalsAreThoseOfClopperAndPearson) {
  const auto expect = [](std::int64_t successes, std::int64_t trials, double low, double high) {
    const auto found = ClopperPearson(successes, trials, 0.05);
    EXPECT_NEAR(found.first, low, 5e-5) << successes << " of " << trials;
    EXPECT_NEAR(found.second, high, 5e-5) << successes << " of " << trials;
  };
  expect(3, 10, 0.0667, 0.6525);
  expect(0, 10, 0, 0.3085);
  expect(10, 10, 0.6915, 1);
  expect(50, 100, 0.3983, 0.6017);
  EXPECT_NEAR(ClopperPearson(0, 1'000'000'000, 0.1).second * 1e9, 3.0, 0.01);
  double sum = 0;
  for (std::int64_t k = 0; k <= 544; ++k) sum += BinomialProbability(544, k, 0.01);
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_NEAR(BinomialTail(544, 3, 0.01) + BinomialProbability(544, 0, 0.01) +
                  BinomialProbability(544, 1, 0.01) + BinomialProbability(544, 2, 0.01) +
                  BinomialProbability(544, 3, 0.01),
              1, 1e-12);
}

// A message without fields is the same in every sample, so its frame is known here.
TEST(Integrity, EnumerationEqualsAReceiverThatIsAskedEachTime) {
  for (const auto& protocol : AllFormats()) {
    const link::Payload start = protocol->Encode(*protocol->Find("start"), {});
    const Bytes payload(start.span().begin(), start.span().end());
    const Bytes frame = protocol->framing->Encode(payload);
    const std::size_t bits = 8 * frame.size();
    std::array<std::int64_t, 2> expected{}, ways{};
    const auto flip = [](Bytes& bytes, std::size_t bit) {
      bytes[bit / 8] ^= static_cast<std::uint8_t>(1 << bit % 8);
    };
    for (std::size_t a = 0; a < bits; ++a) {
      Bytes damaged = frame;
      flip(damaged, a);
      expected[0] += Passed(*protocol->framing, payload, damaged);
      ++ways[0];
      for (std::size_t b = a + 1; b < bits; ++b) {
        Bytes twice = damaged;
        flip(twice, b);
        expected[1] += Passed(*protocol->framing, payload, twice);
        ++ways[1];
      }
    }
    const auto rows = MeasureIntegrity(
        {.protocol = protocol, .message = "start", .errors = ErrorKind::kEnumerate, .levels = {1, 2}});
    for (std::size_t i = 0; i < rows.size(); ++i) {
      EXPECT_EQ(rows[i].frames_count, ways[i]) << TextOf(*protocol);
      EXPECT_EQ(rows[i].passed_check_count, expected[i]) << TextOf(*protocol) << ", " << i + 1 << " bits";
    }
  }
}

// Both CRC-16 have a Hamming distance of 4 up to 32,751 bits, and CRC-32 one of 6 at the length of a start message
// (P. Koopman, "Best CRC Polynomials", Carnegie Mellon University; Koopman and Chakravarty, DSN 2004). A frame without stuffing
// keeps it.
TEST(Integrity, ACrcDetectsUpToThreeWrongBits) {
  for (const CheckKind check :
       {CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc, CheckKind::kCrc32IsoHdlc}) {
    const auto rows =
        MeasureIntegrity({.protocol = PaperWith(link::MakeLengthFraming({.sync = {0xAA, 0x55}}, check)),
                          .message = "actuators",
                          .errors = ErrorKind::kEnumerate});
    for (const IntegrityRow& row : rows)
      EXPECT_EQ(row.passed_check_count, 0) << Name(check) << " " << row.level;
  }
}

// A CRC and a sum miss one in 2^bits of the bursts that are longer than they are.
TEST(Integrity, LongBurstsPassAsOftenAsTheoryHasIt) {
  for (const CheckKind check : {CheckKind::kSum8, CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc}) {
    const IntegrityRow row = MeasureIntegrity({.protocol = PaperWith(link::MakeCobsFraming(check)),
                                               .errors = ErrorKind::kBurst,
                                               .levels = {40},
                                               .frames_count = 300'000})[0];
    EXPECT_LT(row.passed_check.low, *row.theory) << Name(check);
    EXPECT_GT(row.passed_check.high, *row.theory) << Name(check);
    EXPECT_GT(row.passed_check_count, 0) << Name(check);
    EXPECT_LE(row.delivered_wrong_count, row.passed_check_count);
  }
}

// The weighted rates are those of a line whose bits are wrong with the probability, each on its own.
TEST(Integrity, ABitErrorRateGivesWhatABitByBitLineGives) {
  const auto protocol = PaperWith(link::MakeHdlcFraming(CheckKind::kSum8));
  constexpr double kProbability = 0.02;
  const link::Payload start = protocol->Encode(*protocol->Find("start"), {});
  const Bytes payload(start.span().begin(), start.span().end());
  const Bytes frame = protocol->framing->Encode(payload);
  std::mt19937_64 generator(17);
  std::int64_t passed = 0;
  constexpr std::int64_t kFrames = 300'000;
  const auto threshold = static_cast<std::uint64_t>(kProbability * 0x1p32);
  for (std::int64_t i = 0; i < kFrames; ++i) {
    Bytes damaged = frame;
    bool is_damaged = false;
    for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit) {
      if ((generator() >> 32) >= threshold) continue;
      damaged[bit / 8] ^= static_cast<std::uint8_t>(1 << bit % 8);
      is_damaged = true;
    }
    if (is_damaged) passed += Passed(*protocol->framing, payload, damaged);
  }
  const double expected = static_cast<double>(passed) / static_cast<double>(kFrames);
  const double deviation = std::sqrt(expected / static_cast<double>(kFrames));
  const IntegrityRow row = MeasureIntegrity({.protocol = protocol,
                                             .message = "start",
                                             .errors = ErrorKind::kBer,
                                             .levels = {kProbability},
                                             .frames_count = 200'000})[0];
  EXPECT_GT(passed, 100);
  EXPECT_NEAR(row.passed_check.rate, expected, 4 * deviation);
  EXPECT_LE(row.passed_check.low, row.passed_check.rate);
  EXPECT_GE(row.passed_check.high, row.passed_check.rate);
}

TEST(Integrity, ThreadsDoNotMatterAndSeedsDo) {
  for (int i = 0; i <= static_cast<int>(LastOf(ErrorKind())); ++i) {
    const auto kind = static_cast<ErrorKind>(i);
    if (kind == ErrorKind::kBer || kind == ErrorKind::kEnumerate) continue;
    const auto measure = [&](int threads_count, std::uint64_t seed) {
      std::vector<std::int64_t> counts;
      for (const IntegrityRow& row :
           MeasureIntegrity({.protocol = PaperWith(link::MakeCobsFraming(CheckKind::kNone)),
           .errors = kind,
           .levels = {4},
           .frames_count = 140'000,
           .seed = seed,
           .threads_count = threads_count}))
        counts.insert(counts.end(), {row.frames_count, row.passed_check_count, row.delivered_wrong_count});
      return counts;
    };
    EXPECT_EQ(measure(1, 1), measure(3, 1)) << Name(kind);
    if (kind != ErrorKind::kStuck) {
      EXPECT_NE(measure(1, 1), measure(1, 2)) << Name(kind);
    }
  }
}

TEST(Integrity, SpecsThatCannotBeMeasuredAreRefused) {
  const auto protocol = link::FindProtocol("paper");
  EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .message = "nothing"}), std::invalid_argument);
  for (const double level : {0.0, -1.0, 0.5})
    EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .errors = ErrorKind::kBer, .levels = {level}}),
                 std::invalid_argument);
  EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .errors = ErrorKind::kBurst, .levels = {1.5}}),
               std::invalid_argument);
  EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .errors = ErrorKind::kEnumerate, .levels = {4}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::harness
