// Residual errors against a receiver that is asked about every damaged frame, against theory, and against a line whose
// bits are wrong one by one.

#include "harness/integrity/integrity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "harness/integrity/binomial.h"
#include "harness/integrity/damager.h"
#include "harness/integrity/undetected.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/fletcher16.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"

namespace tiltproof::harness {
namespace {

using Bytes = std::vector<std::uint8_t>;
using link::CheckKind;

std::shared_ptr<const link::Protocol> PaperWith(std::shared_ptr<const link::Framing> framing) {
  const auto protocol = std::make_shared<link::Protocol>(*FindProtocol("paper"));
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

// Large numbers take another way to the logarithm of a binomial coefficient. A normal distribution is close to these.
TEST(Binomial, LargeNumbersAreThoseOfTheNormalDistribution) {
  const auto [low, high] = ClopperPearson(3'000'000'000, 10'000'000'000, 0.05);
  const double deviation = std::sqrt(0.3 * 0.7 / 1e10);
  EXPECT_NEAR((low - 0.3) / deviation, -1.959964, 1e-3);
  EXPECT_NEAR((high - 0.3) / deviation, 1.959964, 1e-3);
  const auto below = ClopperPearson(10'000, 1'000'000, 0.05), above = ClopperPearson(10'001, 1'000'000, 0.05);
  EXPECT_NEAR(above.first - below.first, 1e-6, 2e-8);
  EXPECT_NEAR(above.second - below.second, 1e-6, 2e-8);
}

// Trials of which ten each end in the same way are as good as a tenth of them.
TEST(Binomial, ClustersThatEndAlikeCountOnce) {
  std::mt19937_64 generator(5);
  std::vector<Cluster> alike, independent;
  for (int i = 0; i < 4000; ++i) {
    alike.push_back({10, generator() % 4 == 0 ? 10 : 0});
    independent.push_back({10, 0});
    for (int k = 0; k < 10; ++k) independent.back().successes += generator() % 4 == 0 ? 1 : 0;
  }
  EXPECT_NEAR(DesignEffect(alike), 10, 0.1);
  EXPECT_NEAR(DesignEffect(independent), 1, 0.1);
  const auto bounds = ClusteredBounds(alike, 0.05);
  EXPECT_NEAR(bounds.second - bounds.first, 2 * 1.96 * std::sqrt(0.25 * 0.75 / 4000), 1e-3);
}

// The receiver with all three frames, asked about the same damage.
TEST(Integrity, TheFastWayCountsWhatTheWholeReceiverDelivers) {
  faults::Random random(7);
  for (const auto& protocol : AllFormats()) {
    for (const char* message : {"start", "actuators", "reference"}) {
      const link::MessageType& type = *protocol->Find(message);
      const CheckGroup group(*protocol->framing->check(),
                             type.payload_bytes + link::CheckBytes(*protocol->framing->check()));
      for (int block = 0; block < 3; ++block) {
        const FrameSample sample(*protocol, type, random);
        Damager damager(sample, group);
        Counts expected;
        const auto judge = [&](auto&& damage) {
          damage();
          const Bytes damaged(damager.damaged().begin(), damager.damaged().end());
          const Received slow = sample.Receive(damaged);
          EXPECT_EQ(damager.Judge(), slow) << TextOf(*protocol) << " " << message;
          expected += {1, slow.passed_check_count, slow.passed_length_count, slow.accepted_count};
        };
        for (int i = 0; i < 150; ++i) {
          judge([&] { damager.MakeBurst(random, 1 + static_cast<std::size_t>(i) % 40); });
          judge([&] { damager.StickBytes(random, 1 + static_cast<std::size_t>(i) % 4); });
          judge([&] { damager.SwapBytes(random, 1 + static_cast<std::size_t>(i) % 3); });
          const auto count = [&](std::size_t most) { return 1 + static_cast<std::size_t>(i) % most; };
          const auto check = [&](const Received& fast) {
            const Received slow = sample.Receive(damager.other());
            EXPECT_EQ(fast, slow) << TextOf(*protocol) << " " << message;
            expected += {1, slow.passed_check_count, slow.passed_length_count, slow.accepted_count};
          };
          check(damager.JudgeWithWrongBits(random, count(12)));
          check(damager.JudgeWithLost(random, count(3)));
          check(damager.JudgeWithAdded(random, count(3)));
        }
        EXPECT_EQ(damager.counts().passed_check, expected.passed_check)
            << TextOf(*protocol) << " " << message;
        EXPECT_EQ(damager.counts().passed_length, expected.passed_length);
        EXPECT_EQ(damager.counts().delivered_wrong, expected.delivered_wrong);
        EXPECT_EQ(damager.counts().frames, expected.frames);
      }
    }
  }
}

// Most of the damage that the test above draws is detected. Here it is made to fit: a change in the check's blind spot,
// and bytes that read 00 in place of FF.
TEST(Integrity, TheFastWayCountsWhatPassesTheCheck) {
  faults::Random random(11);
  std::int64_t passed_count = 0;
  for (const auto& protocol : AllFormats()) {
    const link::MessageType& type = *protocol->Find("actuators");
    const CheckKind kind = *protocol->framing->check();
    const CheckGroup group(kind, type.payload_bytes + link::CheckBytes(kind));
    for (int i = 0; i < 40; ++i) {
      const FrameSample sample(*protocol, type, random);
      Damager damager(sample, group);
      const auto spot = link::BlindSpotOf(kind);
      Bytes payload(sample.content().begin(),
                    sample.content().begin() + static_cast<std::ptrdiff_t>(type.payload_bytes));
      link::ChangeUnseen(kind, std::span(payload).subspan(5, spot.bytes_count),
                         static_cast<std::uint32_t>(random.Below(spot.ways_count)));
      for (std::size_t place = 0; place < sample.wire().size(); ++place) {
        const std::size_t in_content = sample.ContentPlace(place);
        if (in_content >= payload.size()) continue;
        const int bits = payload[in_content] ^ sample.content()[in_content];
        for (std::size_t bit = 0; bit < 8; ++bit)
          if ((bits >> bit & 1) != 0) damager.FlipBit(8 * place + bit);
      }
      const Bytes damaged(damager.damaged().begin(), damager.damaged().end());
      const Received slow = sample.Receive(damaged);
      EXPECT_EQ(damager.Judge(), slow) << TextOf(*protocol);
      passed_count += slow.passed_check_count;
    }
  }
  EXPECT_GT(passed_count, 300);
}

// A frame whose flags are hit has a byte more, in front or behind, or both. A sum of 8 bits lets one in 256 of them pass.
TEST(Integrity, TheFastWayCountsWhatPassesWithoutAFlag) {
  faults::Random random(13);
  const auto protocol = PaperWith(link::MakeHdlcFraming(CheckKind::kSum8));
  const CheckGroup group(CheckKind::kSum8, protocol->Find("start")->payload_bytes + 1);
  const FrameSample sample(*protocol, *protocol->Find("start"), random);
  Damager damager(sample, group);
  std::array<int, 4> passed{};  // with both flags, without the first, without the last, without both
  for (int i = 0; i < 60'000; ++i) {
    const Received fast = damager.JudgeWithWrongBits(random, 2 + static_cast<std::size_t>(i) % 5);
    const Received slow = sample.Receive(damager.other());
    ASSERT_EQ(fast, slow);
    const bool no_first = damager.other().front() != sample.wire().front();
    const bool no_last = damager.other().back() != sample.wire().back();
    passed[(no_first ? 1 : 0) + (no_last ? 2 : 0)] += slow.passed_check_count;
  }
  EXPECT_THAT(passed, ::testing::Each(::testing::Gt(10)));
}

// Effects of changes, and of a byte in front, against the check itself.
TEST(Integrity, EffectsAddUpToThoseOfTheChangedContent) {
  std::mt19937_64 generator(17);
  for (int i = 0; i <= static_cast<int>(LastOf(CheckKind())); ++i) {
    const auto kind = static_cast<CheckKind>(i);
    const std::size_t bytes = 20 + link::CheckBytes(kind);
    const CheckGroup group(kind, bytes), longer(kind, bytes + 1);
    // Sums have several numbers for one effect, and one number that makes up for it.
    const auto equal = [](const CheckGroup& of, std::uint64_t a, std::uint64_t b) {
      return of.Missing(a) == of.Missing(b);
    };
    for (int round = 0; round < 300; ++round) {
      Bytes content(bytes);
      for (std::uint8_t& byte : content) byte = static_cast<std::uint8_t>(generator());
      const std::uint64_t before = group.Of(content);
      const std::size_t place = generator() % bytes;
      Bytes changed = content;
      changed[place] = static_cast<std::uint8_t>(generator());
      EXPECT_TRUE(equal(group, group.Of(changed),
                        group.Add(before, group.Change(place, content[place], changed[place]))))
          << Name(kind) << " " << place;
      Bytes with_front = content;
      with_front.insert(with_front.begin(), static_cast<std::uint8_t>(generator()));
      EXPECT_TRUE(equal(longer, longer.Of(with_front), group.Add(before, group.InFront(with_front[0]))))
          << Name(kind);
      const std::span<const std::uint8_t> payload = std::span(content).first(20);
      Bytes whole(payload.begin(), payload.end());
      for (std::size_t at = 0; at < link::CheckBytes(kind); ++at)
        whole.push_back(link::CheckByte(kind, link::Checksum(kind, payload), at));
      EXPECT_EQ(group.Of(whole), 0U) << Name(kind);
    }
  }
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
// (P. Koopman, "Best CRC Polynomials", Carnegie Mellon University; Koopman and Chakravarty, DSN 2004). A frame without
// stuffing keeps it, apart from those with a damaged length, which the check does not cover.
TEST(Integrity, ACrcDetectsUpToThreeWrongBits) {
  for (const CheckKind check :
       {CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc, CheckKind::kCrc32IsoHdlc}) {
    const auto rows =
        MeasureIntegrity({.protocol = PaperWith(link::MakeLengthFraming({.sync = {0xAA, 0x55}}, check)),
                          .message = "actuators",
                          .errors = ErrorKind::kEnumerate});
    for (const IntegrityRow& row : rows) {
      EXPECT_EQ(row.passed_length_count, 0) << Name(check) << " " << row.level;
      EXPECT_EQ(row.theory, 0) << Name(check) << " " << row.level;
    }
  }
}

// All patterns of four bits, tried out one by one with the check itself.
TEST(Integrity, TheoryCountsThePatternsThatACrcDoesNotDetect) {
  const std::size_t payload_bytes = 8;
  for (const CheckKind kind : {CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc}) {
    const std::size_t content_bytes = payload_bytes + 2, bits = 8 * content_bytes;
    Bytes content(content_bytes);
    const std::uint32_t check = link::Checksum(kind, std::span(content).first(payload_bytes));
    for (std::size_t i = 0; i < 2; ++i) content[payload_bytes + i] = link::CheckByte(kind, check, i);
    const auto holds = [&] {
      const std::span<const std::uint8_t> all(content);
      return link::Checksum(kind, all.first(payload_bytes)) ==
             link::LoadCheck(kind, all.subspan(payload_bytes));
    };
    const auto flip = [&](std::size_t bit) { content[bit / 8] ^= static_cast<std::uint8_t>(1 << bit % 8); };
    std::int64_t passed = 0;
    for (std::size_t a = 0; a < bits; ++a)
      for (std::size_t b = a + 1; b < bits; ++b)
        for (std::size_t c = b + 1; c < bits; ++c)
          for (std::size_t d = c + 1; d < bits; ++d) {
            for (const std::size_t bit : {a, b, c, d}) flip(bit);
            passed += holds() ? 1 : 0;
            for (const std::size_t bit : {a, b, c, d}) flip(bit);
          }
    const UndetectedErrors errors(kind, content_bytes);
    EXPECT_EQ(errors.Count(4), static_cast<double>(passed)) << Name(kind);
    EXPECT_EQ(errors.HammingDistance(), 4);
    EXPECT_EQ(errors.Count(3), 0);
    EXPECT_EQ(errors.Count(5), 0);
  }
}

// The Hamming distances of CRC-32 by the length of the data: 6 up to 268 bits, 5 up to 2974 bits (Koopman, as above).
TEST(Integrity, TheoryHasThePublishedDistancesOfCrc32) {
  EXPECT_EQ(UndetectedErrors(CheckKind::kCrc32IsoHdlc, 33 + 4).HammingDistance(), 0) << "6 is not counted";
  EXPECT_EQ(UndetectedErrors(CheckKind::kCrc32IsoHdlc, 34 + 4).HammingDistance(), 5);
  EXPECT_EQ(UndetectedErrors(CheckKind::kCrc32IsoHdlc, 64 + 4).HammingDistance(), 5);
}

// Mean numbers over random data, from frames without stuffing. The means of three bits are over few frames.
TEST(Integrity, TheorySaysWhatSumsMiss) {
  for (const CheckKind kind : {CheckKind::kFletcher16, CheckKind::kSum8}) {
    const std::size_t payload_bytes = 20;
    const CheckGroup group(kind, payload_bytes + link::CheckBytes(kind));
    const UndetectedErrors errors(kind, group.content_bytes());
    std::mt19937_64 generator(3);
    std::array<double, 4> passed{};
    constexpr int kFrames = 300;
    for (int frame = 0; frame < kFrames; ++frame) {
      std::vector<std::uint64_t> effects;
      std::vector<std::uint8_t> bytes(payload_bytes);
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(generator());
      const std::uint32_t check = link::Checksum(kind, bytes);
      for (std::size_t i = 0; i < link::CheckBytes(kind); ++i)
        bytes.push_back(link::CheckByte(kind, check, i));
      for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit)
        effects.push_back(
            group.Change(bit / 8, bytes[bit / 8], static_cast<std::uint8_t>(bytes[bit / 8] ^ 1 << bit % 8)));
      for (std::size_t a = 0; a < effects.size(); ++a) {
        passed[1] += group.MayHold(effects[a]) ? 1 : 0;
        for (std::size_t b = a + 1; b < effects.size(); ++b) {
          const std::uint64_t two = group.Add(effects[a], effects[b]);
          passed[2] += group.MayHold(two) ? 1 : 0;
          for (std::size_t c = b + 1; c < effects.size(); ++c)
            passed[3] += group.MayHold(group.Add(two, effects[c])) ? 1 : 0;
        }
      }
    }
    EXPECT_EQ(passed[1], 0);
    for (std::size_t k = 2; k <= 3; ++k)
      EXPECT_NEAR(passed[k] / kFrames, errors.Count(static_cast<int>(k)),
                  0.03 * errors.Count(static_cast<int>(k)))
          << Name(kind) << " " << k;
  }
}

// Two wrong bits pass a plain sum when they have one weight and make up for each other: always at the highest weight, for
// half of all data at the seven others. In long messages that is 9 of 128 errors of two bits.
TEST(Integrity, APlainSumMissesTwoBitsOfOneWeight) {
  for (const double bytes : {2.0, 21.0, 68.0, 1024.0}) {
    const double pairs_of_bytes = bytes * (bytes - 1) / 2, pairs_of_bits = 8 * bytes * (8 * bytes - 1) / 2;
    const double counted = UndetectedErrors(CheckKind::kSum8, static_cast<std::size_t>(bytes)).Count(2);
    EXPECT_NEAR(counted / (pairs_of_bytes * (1 + 7 / 2.0)), 1, 1e-12) << bytes;
    if (bytes > 1000) {
      EXPECT_NEAR(counted / pairs_of_bits, 9.0 / 128, 1e-4);
    }
  }
}

// Fletcher's own figure: with sums modulo 255, two wrong bits pass only when they are 2040 bits apart or more (IEEE
// Transactions on Communications 30(1), 1982, table 1).
TEST(Integrity, TwoWrongBitsPassFletchersSumsFrom2040BitsOn) {
  Bytes bytes(600);
  const std::uint16_t intact = link::Fletcher16(bytes);
  std::size_t least = ~std::size_t{};
  for (std::size_t a = 0; a < 24; ++a) {
    for (std::size_t b = a + 1; b < 8 * bytes.size(); ++b) {
      // One bit falls and the other one rises.
      Bytes before = bytes, behind = bytes;
      before[a / 8] = static_cast<std::uint8_t>(1 << a % 8);
      behind[b / 8] = static_cast<std::uint8_t>(1 << b % 8);
      if (link::Fletcher16(before) == link::Fletcher16(behind)) least = std::min(least, b - a);
    }
  }
  EXPECT_EQ(least, 2040);
  bytes[300] = 0xFF;
  EXPECT_EQ(link::Fletcher16(bytes), intact) << "00 and FF are the same number";
}

// A CRC and a sum miss one in 2^bits of the bursts that are longer than they are.
TEST(Integrity, LongBurstsPassAsOftenAsTheoryHasIt) {
  for (const CheckKind check : {CheckKind::kSum8, CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc}) {
    const IntegrityRow row = MeasureIntegrity({.protocol = PaperWith(link::MakeCobsFraming(check)),
                                               .errors = ErrorKind::kBurst,
                                               .levels = {40},
                                               .frames_count = 300'000})[0];
    EXPECT_NEAR(row.passed_check.rate, *row.theory,
                4 * std::sqrt(*row.theory / static_cast<double>(row.frames_count)))
        << Name(check);
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

// Where frames differ a lot, the bounds of some seeds must leave out the mean of all of them, but of few.
TEST(Integrity, BoundsHoldTheRateForAlmostAllSeeds) {
  for (const auto& [errors, level] : {std::pair{ErrorKind::kStuck, 2.0}, {ErrorKind::kBurst, 24.0}}) {
    constexpr int kSeeds = 60;
    std::vector<Rate> rates;
    double mean = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      rates.push_back(MeasureIntegrity({.protocol = PaperWith(link::MakeHdlcFraming(CheckKind::kSum8)),
                                        .message = "actuators",
                                        .errors = errors,
                                        .levels = {level},
                                        .frames_count = 8000,
                                        .seed = static_cast<std::uint64_t>(seed)})[0]
                          .passed_check);
      mean += rates.back().rate / kSeeds;
    }
    int held = 0;
    for (const Rate& rate : rates) held += rate.low <= mean && mean <= rate.high ? 1 : 0;
    EXPECT_GE(held, kSeeds - 8) << Name(errors);
    EXPECT_GT(mean, 0);
  }
}

TEST(Integrity, ThreadsDoNotMatterAndSeedsDo) {
  for (int i = 0; i <= static_cast<int>(LastOf(ErrorKind())); ++i) {
    const auto kind = static_cast<ErrorKind>(i);
    const bool in_all_ways = kind == ErrorKind::kBer || kind == ErrorKind::kEnumerate;
    const auto measure = [&](int threads_count, std::uint64_t seed) {
      std::vector<double> found;
      for (const IntegrityRow& row :
           MeasureIntegrity({.protocol = PaperWith(
                                 link::MakeCobsFraming(in_all_ways ? CheckKind::kSum8 : CheckKind::kNone)),
           .message = in_all_ways ? "start" : "",
           .errors = kind,
           .levels = {kind == ErrorKind::kBer ? 0.02
                      : in_all_ways           ? 2
                                              : 4},
           .frames_count = 140'000,
           .seed = seed,
           .threads_count = threads_count})) {
        found.insert(found.end(),
                     {static_cast<double>(row.frames_count), static_cast<double>(row.passed_check_count),
                      static_cast<double>(row.delivered_wrong_count)});
        for (const Rate& rate : {row.passed_check, row.passed_length, row.delivered_wrong})
          found.insert(found.end(), {rate.rate, rate.low, rate.high});
      }
      return found;
    };
    EXPECT_EQ(measure(1, 1), measure(3, 1)) << Name(kind);
    if (kind != ErrorKind::kStuck && kind != ErrorKind::kEnumerate) {
      EXPECT_TRUE(measure(1, 1) != measure(1, 2) || measure(1, 1) != measure(1, 3)) << Name(kind);
    }
  }
}

TEST(Integrity, SpecsThatCannotBeMeasuredAreRefused) {
  const auto protocol = FindProtocol("paper");
  EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .message = "nothing"}), std::invalid_argument);
  link::Protocol silent = *protocol;
  std::erase_if(silent.messages,
                [](const link::MessageType& type) { return type.direction == link::Direction::kToClient; });
  EXPECT_THROW(MeasureIntegrity({.protocol = std::make_shared<link::Protocol>(silent)}),
               std::invalid_argument);
  for (const double level : {0.0, -1.0, 0.6})
    EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .errors = ErrorKind::kBer, .levels = {level}}),
                 std::invalid_argument);
  EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .errors = ErrorKind::kBurst, .levels = {1.5}}),
               std::invalid_argument);
  EXPECT_THROW(MeasureIntegrity({.protocol = protocol, .errors = ErrorKind::kEnumerate, .levels = {4}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::harness
