#include "harness/integrity/integrity.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <thread>

#include "harness/integrity/binomial.h"
#include "harness/integrity/damager.h"
#include "harness/integrity/undetected.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using faults::KeyOf;
using faults::Random;
using faults::StreamKey;

// The work is done in blocks, each with an intact frame and draws of its own, whichever thread does it. There are enough
// of them to see how much frames differ. Where the damage itself is drawn from few possibilities, blocks are small.
constexpr std::int64_t kBlocksMin = 64, kBlockFrames = 1 << 14, kSmallBlockFrames = 1 << 8;
// Numbers of wrong bits that are counted in all their ways: at most these, and with at most so many ways.
constexpr int kEnumeratedBits = 3;
constexpr double kEnumeratedWays = 1e8;
// Intact frames whose wrong bits are counted in all ways for a bit error rate.
constexpr std::size_t kEnumeratedFrames = 16, kEnumeratedFramesOfThree = 2;
constexpr double kBitErrorRateMax = 0.5;
constexpr double kErrorProbability = 0.05;

using Blocks = std::vector<Counts>;
using Damage = std::function<void(Damager&, Random&)>;

// The work of one level, in blocks.
class Measurement {
 public:
  explicit Measurement(const IntegritySpec& spec)
      : spec_(spec),
        type_(spec.message.empty() ? DefaultMessage(*spec.protocol) : spec.protocol->Find(spec.message)) {
    const std::string name = "protocol '" + spec.protocol->name + "'";
    if (type_ == nullptr) throw std::invalid_argument(name + " has no message '" + spec.message + "'");
    const auto kind = spec.protocol->framing->check();
    if (!kind) throw std::invalid_argument(name + " has a check of its own");
    group_.emplace(*kind, type_->payload_bytes + link::CheckBytes(*kind));
  }

  // Frames that `damage` damages, each once.
  Blocks Draw(std::string_view name, std::int64_t frames_count, std::int64_t block_frames,
              const Damage& damage) const {
    const std::uint64_t stream = StreamKey(spec_.seed, {spec_.protocol->name, type_->name, name});
    frames_count = std::max<std::int64_t>(frames_count, 1);
    block_frames = std::clamp<std::int64_t>(frames_count / kBlocksMin, 1, block_frames);
    Blocks blocks(static_cast<std::size_t>((frames_count + block_frames - 1) / block_frames));
    InThreads(blocks.size(), [&](std::size_t block) {
      Random random(KeyOf(stream, block));
      const FrameSample sample(*spec_.protocol, *type_, random);
      Damager damager(sample, *group_);
      const std::int64_t first = static_cast<std::int64_t>(block) * block_frames;
      const std::int64_t end = std::min(first + block_frames, frames_count);
      for (std::int64_t i = first; i < end; ++i) damage(damager, random);
      blocks[block] = damager.counts();
    });
    return blocks;
  }

  // All frames that differ in `count` bits from one of so many frames. One block for each frame.
  Blocks Enumerate(int count, std::size_t frames_count) const {
    const std::uint64_t stream = StreamKey(spec_.seed, {spec_.protocol->name, type_->name, "enumerate"});
    std::vector<FrameSample> samples;
    for (std::size_t i = 0; i < frames_count; ++i) {
      Random random(KeyOf(stream, i));
      samples.emplace_back(*spec_.protocol, *type_, random);
    }
    // One piece of work for each wrong bit that is the first.
    std::vector<std::pair<std::size_t, std::size_t>> works;
    for (std::size_t i = 0; i < frames_count; ++i)
      for (std::size_t bit = 0; bit < 8 * samples[i].wire().size(); ++bit) works.emplace_back(i, bit);
    std::vector<Counts> of_works(works.size());
    InThreads(works.size(), [&](std::size_t work) {
      Damager damager(samples[works[work].first], *group_);
      damager.JudgeAllFrom(works[work].second, count);
      of_works[work] = damager.counts();
    });
    Blocks blocks(frames_count);
    for (std::size_t work = 0; work < works.size(); ++work) blocks[works[work].first] += of_works[work];
    return blocks;
  }

  // Bits of a frame, of which stuffing makes some longer.
  std::int64_t bits_count() const {
    Random random(KeyOf(StreamKey(spec_.seed, {spec_.protocol->name, type_->name, "enumerate"}), 0));
    return static_cast<std::int64_t>(8 * FrameSample(*spec_.protocol, *type_, random).wire().size());
  }
  const CheckGroup& group() const { return *group_; }

 private:
  void InThreads(std::size_t count, const std::function<void(std::size_t)>& work) const {
    std::atomic<std::size_t> next = 0;
    const auto run = [&] {
      for (std::size_t i = next++; i < count; i = next++) work(i);
    };
    std::vector<std::jthread> others;
    for (int i = 1; i < spec_.threads_count; ++i) others.emplace_back(run);
    run();
  }

  const IntegritySpec& spec_;
  const link::MessageType* type_;
  std::optional<CheckGroup> group_;
};

// `error_probability`: that the share is not between the bounds.
Rate RateOf(const Blocks& blocks, std::int64_t Counts::*count, double error_probability) {
  std::vector<Cluster> clusters;
  Counts all;
  for (const Counts& block : blocks) {
    clusters.push_back({block.frames, block.*count});
    all += block;
  }
  const auto [low, high] = ClusteredBounds(clusters, error_probability);
  return {
      .rate = static_cast<double>(all.*count) / static_cast<double>(all.frames), .low = low, .high = high};
}

IntegrityRow RowOf(double level, const Blocks& blocks) {
  Counts all;
  for (const Counts& block : blocks) all += block;
  return {.level = level,
          .frames_count = all.frames,
          .passed_check_count = all.passed_check,
          .passed_length_count = all.passed_length,
          .delivered_wrong_count = all.delivered_wrong,
          .passed_check = RateOf(blocks, &Counts::passed_check, kErrorProbability),
          .passed_length = RateOf(blocks, &Counts::passed_length, kErrorProbability),
          .delivered_wrong = RateOf(blocks, &Counts::delivered_wrong, kErrorProbability),
          .theory = {}};
}

// The numbers of wrong bits that are counted in all ways, of a frame with so many bits.
int EnumeratedBits(std::int64_t bits) {
  const auto n = static_cast<double>(bits);
  return n * (n - 1) * (n - 2) / 6 <= kEnumeratedWays ? kEnumeratedBits : kEnumeratedBits - 1;
}

// The probabilities that at most k of all bits are wrong, when more than `least` are; from least + 1 on.
std::vector<double> MoreWrongBits(std::int64_t bits, int least, double p) {
  const double all = BinomialTail(bits, least, p);
  std::vector<double> sums;
  double sum = 0;
  for (std::int64_t k = least + 1; k <= bits && sum < 1 - 0x1p-52; ++k)
    sums.push_back(sum += BinomialProbability(bits, k, p) / all);
  return sums;
}

// Frames of a line with a bit error rate, by the number of their wrong bits.
class BitErrors {
 public:
  BitErrors(const Measurement& measurement, const IntegritySpec& spec)
      : measurement_(measurement),
        spec_(spec),
        bits_(measurement.bits_count()),
        enumerated_(EnumeratedBits(bits_)),
        theory_(measurement.group().kind(), measurement.group().content_bytes()) {
    for (int count = 1; count <= enumerated_; ++count)
      in_all_ways_.push_back(
          measurement.Enumerate(count, count < 3 ? kEnumeratedFrames : kEnumeratedFramesOfThree));
  }

  IntegrityRow At(double p) const {
    const std::vector<double> sums = MoreWrongBits(bits_, enumerated_, p);
    const Blocks drawn =
        measurement_.Draw("ber " + std::to_string(std::bit_cast<std::uint64_t>(p)), spec_.frames_count,
                          kBlockFrames, [&](Damager& damager, Random& random) {
                            const double u = random.Uniform();
                            std::size_t more = 0;
                            while (more + 1 < sums.size() && u >= sums[more]) ++more;
                            const std::size_t count = static_cast<std::size_t>(enumerated_) + 1 + more;
                            damager.JudgeWithWrongBits(random, std::min(count, damager.bits_count()));
                          });
    IntegrityRow row = RowOf(p, drawn);
    for (const Blocks& blocks : in_all_ways_) {
      for (const Counts& block : blocks) {
        row.frames_count += block.frames;
        row.passed_check_count += block.passed_check;
        row.passed_length_count += block.passed_length;
        row.delivered_wrong_count += block.delivered_wrong;
      }
    }
    row.passed_check = Weighted(drawn, &Counts::passed_check, p);
    row.passed_length = Weighted(drawn, &Counts::passed_length, p);
    row.delivered_wrong = Weighted(drawn, &Counts::delivered_wrong, p);
    row.theory = theory_.RateAt(p);
    return row;
  }

 private:
  Rate Weighted(const Blocks& drawn, std::int64_t Counts::*count, double p) const {
    Rate all;
    const double probability = kErrorProbability / (enumerated_ + 1);
    const auto add = [&](const Rate& own, double weight) {
      all.rate += weight * own.rate;
      all.low += weight * own.low;
      all.high += weight * own.high;
    };
    for (int bits = 1; bits <= enumerated_; ++bits) {
      Rate own = RateOf(in_all_ways_[static_cast<std::size_t>(bits - 1)], count, probability);
      // All ways of several frames: none means that there is none.
      if (own.rate == 0) own.high = 0;
      add(own, BinomialProbability(bits_, bits, p));
    }
    add(RateOf(drawn, count, probability), BinomialTail(bits_, enumerated_, p));
    return all;
  }

  const Measurement& measurement_;
  const IntegritySpec& spec_;
  std::int64_t bits_;
  int enumerated_;
  UndetectedErrors theory_;
  std::vector<Blocks> in_all_ways_;  // [i]: with i + 1 wrong bits
};

// The share of bursts that pass a check, by theory. A CRC detects every burst that is not longer than itself, and of those
// one bit longer all but one.
double TheoryOfBurst(const CheckGroup& group, std::size_t length) {
  const auto bits = 8 * link::CheckBytes(group.kind());
  if (!group.is_linear() || length > bits + 1) return std::exp2(-static_cast<double>(bits));
  return length <= bits ? 0 : std::exp2(1 - static_cast<double>(bits));
}

IntegrityRow AtLevel(const Measurement& measurement, const IntegritySpec& spec, double level) {
  const auto count = static_cast<std::size_t>(level);
  const std::string name = std::string(Name(spec.errors)) + " " + std::to_string(count);
  const auto draw = [&](std::int64_t frames_count, std::int64_t block_frames, const Damage& damage) {
    return RowOf(level, measurement.Draw(name, frames_count, block_frames, damage));
  };
  switch (spec.errors) {
    case ErrorKind::kBurst: {
      IntegrityRow row = draw(spec.frames_count, kBlockFrames, [&](Damager& damager, Random& random) {
        damager.MakeBurst(random, count);
        damager.Judge();
      });
      row.theory = TheoryOfBurst(measurement.group(), count);
      return row;
    }
    case ErrorKind::kStuck:
      return draw(spec.frames_count, kSmallBlockFrames, [&](Damager& damager, Random& random) {
        damager.StickBytes(random, count);
        damager.Judge();
      });
    case ErrorKind::kSwap:
      return draw(spec.frames_count, kSmallBlockFrames, [&](Damager& damager, Random& random) {
        damager.SwapBytes(random, count);
        damager.Judge();
      });
    case ErrorKind::kLoss:
      return draw(spec.frames_count / 10, kSmallBlockFrames,
                  [&](Damager& damager, Random& random) { damager.JudgeWithLost(random, count); });
    case ErrorKind::kInsert:
      return draw(spec.frames_count / 10, kBlockFrames,
                  [&](Damager& damager, Random& random) { damager.JudgeWithAdded(random, count); });
    case ErrorKind::kEnumerate: {
      IntegrityRow row = RowOf(level, measurement.Enumerate(static_cast<int>(count), 1));
      for (Rate* rate : {&row.passed_check, &row.passed_length, &row.delivered_wrong})
        rate->low = rate->high = rate->rate;
      row.theory = UndetectedErrors(measurement.group().kind(), measurement.group().content_bytes())
                       .Count(static_cast<int>(count)) /
                   static_cast<double>(row.frames_count);
      return row;
    }
    case ErrorKind::kBer:
      break;
  }
  ThrowBrokenInvariant("errors that are measured level by level");
}

void CheckLevels(ErrorKind errors, const std::vector<double>& levels) {
  const double highest = errors == ErrorKind::kBer         ? kBitErrorRateMax
                         : errors == ErrorKind::kEnumerate ? kEnumeratedBits
                                                           : 1024;
  for (const double level : levels) {
    const bool in_range = level > 0 && level <= highest;
    if (!in_range || (errors != ErrorKind::kBer && level != std::floor(level)))
      throw std::invalid_argument(
          "a level of '" + std::string(Name(errors)) + "' is " +
          (errors == ErrorKind::kBer
               ? "above 0 and at most 0.5"
               : "a whole number from 1 to " + std::to_string(static_cast<int>(highest))));
  }
}

}  // namespace

std::string_view Name(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::kBer:
      return "ber";
    case ErrorKind::kBurst:
      return "burst";
    case ErrorKind::kStuck:
      return "stuck";
    case ErrorKind::kSwap:
      return "swap";
    case ErrorKind::kLoss:
      return "loss";
    case ErrorKind::kInsert:
      return "insert";
    case ErrorKind::kEnumerate:
      return "enumerate";
  }
  return "unknown";
}

std::vector<double> LevelsOf(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::kBer:
      return {1e-6, 1e-5, 1e-4, 1e-3, 1e-2};
    case ErrorKind::kBurst:
      return {8, 16, 17, 24, 32, 33, 64};
    case ErrorKind::kStuck:
    case ErrorKind::kSwap:
    case ErrorKind::kLoss:
    case ErrorKind::kInsert:
      return {1, 2, 4, 8};
    case ErrorKind::kEnumerate:
      return {1, 2, 3};
  }
  return {};
}

const link::MessageType* DefaultMessage(const link::Protocol& protocol) {
  if (const link::MessageType* reply = protocol.Find(link::MessageKind::kReply)) return reply;
  const link::MessageType* longest = nullptr;
  for (const link::MessageType& type : protocol.messages)
    if (type.direction == link::Direction::kToClient &&
        (longest == nullptr || type.payload_bytes > longest->payload_bytes))
      longest = &type;
  return longest;
}

std::vector<IntegrityRow> MeasureIntegrity(const IntegritySpec& spec) {
  const Measurement measurement(spec);
  const std::vector<double> levels = spec.levels.empty() ? LevelsOf(spec.errors) : spec.levels;
  CheckLevels(spec.errors, levels);
  std::vector<IntegrityRow> rows;
  if (spec.errors != ErrorKind::kBer) {
    for (const double level : levels) rows.push_back(AtLevel(measurement, spec, level));
    return rows;
  }
  const BitErrors bit_errors(measurement, spec);
  for (const double level : levels) rows.push_back(bit_errors.At(level));
  return rows;
}

}  // namespace tiltproof::harness
