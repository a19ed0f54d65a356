#include "harness/integrity/integrity.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <thread>

#include "harness/integrity/binomial.h"
#include "harness/integrity/frame_sample.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using faults::KeyOf;
using faults::Random;
using faults::StreamKey;

// A stretch of the work with frames and draws of its own, whichever thread does it.
constexpr std::int64_t kBlockFrames = 1 << 16;
// Numbers of wrong bits that are counted in all their ways, and the largest that is drawn.
constexpr int kEnumeratedBits = 3, kDrawnBitsMax = 40;
constexpr double kBitErrorRateMax = 0.02;  // a frame of 160 bytes hardly has more than kDrawnBitsMax there
constexpr double kErrorProbability = 0.05;

struct Counts {
  std::int64_t frames = 0, passed_check = 0, delivered_wrong = 0;
  Counts& operator+=(const Counts& other) {
    frames += other.frames;
    passed_check += other.passed_check;
    delivered_wrong += other.delivered_wrong;
    return *this;
  }
};

// Damage of one frame after the other.
class Damager {
 public:
  Damager(const FrameSample& sample, link::CheckKind kind)
      : sample_(sample), check_(kind, sample.content().size()), changes_(sample.wire().size()) {}

  std::size_t bits_count() const { return 8 * sample_.wire().size(); }
  std::size_t bytes_count() const { return sample_.wire().size(); }
  std::uint8_t byte(std::size_t place) const { return sample_.wire()[place]; }

  void FlipBit(std::size_t bit) { Change(bit / 8, static_cast<std::uint8_t>(1 << bit % 8)); }
  // Flips these bits of a byte.
  void Change(std::size_t place, std::uint8_t bits) {
    if (changes_[place] == 0) places_.push_back(place);
    changes_[place] ^= bits;
  }
  // Judges the changes since the last call.
  void Judge() {
    ++counts_.frames;
    if (MayPass()) {
      damaged_.assign(sample_.wire().begin(), sample_.wire().end());
      for (const std::size_t place : places_) damaged_[place] ^= changes_[place];
      Receive();
    }
    for (const std::size_t place : places_) changes_[place] = 0;
    places_.clear();
  }
  // Judges a frame of another length.
  void Judge(std::span<const std::uint8_t> damaged) {
    ++counts_.frames;
    damaged_.assign(damaged.begin(), damaged.end());
    Receive();
  }
  const Counts& counts() const { return counts_; }

 private:
  // False only if the receiver finds the frame where it was sent, and its check wrong.
  bool MayPass() {
    check_.Begin(sample_.content());
    bool is_changed = false;
    for (const std::size_t place : places_) {
      if (changes_[place] == 0) continue;
      const std::uint8_t from = byte(place);
      const auto to = static_cast<std::uint8_t>(from ^ changes_[place]);
      const std::size_t in_content = sample_.ContentPlace(place);
      if (in_content == FrameSample::kNone || sample_.IsSpecial(to)) return true;
      const std::uint8_t value = sample_.content()[in_content];
      check_.Change(in_content, value, static_cast<std::uint8_t>(value ^ changes_[place]));
      is_changed = true;
    }
    return is_changed && check_.Holds();
  }
  void Receive() {
    const Received received = sample_.Receive(damaged_);
    counts_.passed_check += received.passed_check_count;
    counts_.delivered_wrong += received.accepted_count;
  }

  const FrameSample& sample_;
  FrameCheck check_;
  std::vector<std::uint8_t> changes_;  // of each byte of the frame
  std::vector<std::size_t> places_;    // of bytes that are changed
  std::vector<std::uint8_t> damaged_;
  Counts counts_;
};

void FlipRandomBits(Damager& damager, Random& random, int count) {
  std::array<std::size_t, kDrawnBitsMax> bits;
  for (int i = 0; i < count;) {
    const std::size_t bit = random.Below(damager.bits_count());
    const auto end = bits.begin() + i;
    if (std::find(bits.begin(), end, bit) != end) continue;
    bits[static_cast<std::size_t>(i++)] = bit;
    damager.FlipBit(bit);
  }
}

void MakeBurst(Damager& damager, Random& random, std::size_t length) {
  length = std::min(length, damager.bits_count());
  const std::size_t first = random.Below(damager.bits_count() - length + 1);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < length; ++i) {
    if (i % 64 == 0) bits = random();
    if (i == 0 || i + 1 == length || (bits >> i % 64 & 1) != 0) damager.FlipBit(first + i);
  }
}

void StickBytes(Damager& damager, Random& random, std::size_t count) {
  count = std::min(count, damager.bytes_count());
  const std::uint8_t stuck = random.Bernoulli(0.5) ? 0xFF : 0x00;
  const std::size_t first = random.Below(damager.bytes_count() - count + 1);
  for (std::size_t i = first; i < first + count; ++i)
    damager.Change(i, static_cast<std::uint8_t>(damager.byte(i) ^ stuck));
}

// Pairs may have a byte in common: then it is moved on.
void SwapBytes(Damager& damager, Random& random, std::size_t count) {
  std::vector<std::uint8_t> bytes(damager.bytes_count());
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = damager.byte(i);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t first = random.Below(bytes.size() - 1);
    std::swap(bytes[first], bytes[first + 1]);
  }
  for (std::size_t i = 0; i < bytes.size(); ++i)
    if (bytes[i] != damager.byte(i)) damager.Change(i, static_cast<std::uint8_t>(bytes[i] ^ damager.byte(i)));
}

std::vector<std::uint8_t> OfOtherLength(const FrameSample& sample, Random& random, bool inserts,
                                        std::size_t count) {
  std::vector<std::uint8_t> bytes(sample.wire().begin(), sample.wire().end());
  for (std::size_t i = 0; i < count && !bytes.empty(); ++i) {
    const auto at =
        bytes.begin() + static_cast<std::ptrdiff_t>(random.Below(bytes.size() + (inserts ? 1 : 0)));
    if (inserts) {
      bytes.insert(at, static_cast<std::uint8_t>(random.Below(256)));
    } else {
      bytes.erase(at);
    }
  }
  return bytes;
}

// All ways in which `count` bits from `first` on are wrong beside those that are.
void EnumerateBits(Damager& damager, int count, std::vector<std::size_t>& bits) {
  if (count == 0) {
    for (const std::size_t bit : bits) damager.FlipBit(bit);
    damager.Judge();
    return;
  }
  for (std::size_t bit = bits.empty() ? 0 : bits.back() + 1; bit < damager.bits_count(); ++bit) {
    bits.push_back(bit);
    EnumerateBits(damager, count - 1, bits);
    bits.pop_back();
  }
}

// The work of one level, in blocks.
class Measurement {
 public:
  explicit Measurement(const IntegritySpec& spec)
      : spec_(spec), type_(spec.protocol->Find(spec.message)), kind_(spec.protocol->framing->check()) {
    if (type_ == nullptr)
      throw std::invalid_argument("protocol '" + spec.protocol->name + "' has no message '" + spec.message +
                                  "'");
    if (!kind_) throw std::invalid_argument("protocol '" + spec.protocol->name + "' has a check of its own");
  }

  // Frames that `damage` damages, each once.
  Counts Draw(std::string_view name, std::int64_t frames_count,
              const std::function<void(Damager&, const FrameSample&, Random&)>& damage) const {
    const std::uint64_t stream = StreamKey(spec_.seed, {spec_.protocol->name, spec_.message, name});
    const std::int64_t blocks_count = (frames_count + kBlockFrames - 1) / kBlockFrames;
    std::vector<Counts> of_blocks(static_cast<std::size_t>(blocks_count));
    InThreads(of_blocks.size(), [&](std::size_t block) {
      Random random(KeyOf(stream, block));
      const FrameSample sample(*spec_.protocol, *type_, random);
      Damager damager(sample, *kind_);
      const std::int64_t first = static_cast<std::int64_t>(block) * kBlockFrames;
      for (std::int64_t i = first; i < std::min(first + kBlockFrames, frames_count); ++i)
        damage(damager, sample, random);
      of_blocks[block] = damager.counts();
    });
    Counts all;
    for (const Counts& counts : of_blocks) all += counts;
    return all;
  }

  // All frames that differ from one in `count` bits.
  Counts Enumerate(int count) const {
    Random random(StreamKey(spec_.seed, {spec_.protocol->name, spec_.message, "enumerate"}));
    const FrameSample sample(*spec_.protocol, *type_, random);
    const std::size_t bits_count = 8 * sample.wire().size();
    std::vector<Counts> of_firsts(bits_count);
    InThreads(bits_count, [&](std::size_t first) {
      Damager damager(sample, *kind_);
      std::vector<std::size_t> bits = {first};
      EnumerateBits(damager, count - 1, bits);
      of_firsts[first] = damager.counts();
    });
    Counts all;
    for (const Counts& counts : of_firsts) all += counts;
    return all;
  }

  // Longest frame of the message that the samples have.
  std::size_t bits_count() const {
    Random random(StreamKey(spec_.seed, {spec_.protocol->name, spec_.message, "enumerate"}));
    return 8 * FrameSample(*spec_.protocol, *type_, random).wire().size();
  }
  link::CheckKind kind() const { return *kind_; }

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
  std::optional<link::CheckKind> kind_;
};

// `error_probability`: that the share is not between the bounds.
Rate RateOf(std::int64_t count, std::int64_t frames, double error_probability) {
  const auto [low, high] = ClopperPearson(count, frames, error_probability);
  return {.rate = static_cast<double>(count) / static_cast<double>(frames), .low = low, .high = high};
}

double TheoryOf(link::CheckKind kind) {
  return std::exp2(-8.0 * static_cast<double>(link::CheckBytes(kind)));
}

// Shares of wrong frames for each number of wrong bits.
struct OfWrongBits {
  std::vector<Counts> counts;  // [i]: of i + 1 bits
};

OfWrongBits MeasureWrongBits(const Measurement& measurement, std::int64_t frames_count) {
  OfWrongBits all;
  for (int bits = 1; bits <= kDrawnBitsMax; ++bits) {
    if (bits <= kEnumeratedBits) {
      all.counts.push_back(measurement.Enumerate(bits));
    } else {
      // Few wrong bits decide the rates of good lines.
      const std::int64_t share = bits <= 8 ? 8 : 40;
      all.counts.push_back(
          measurement.Draw("bits " + std::to_string(bits), std::max<std::int64_t>(frames_count / share, 1),
                           [bits](Damager& damager, const FrameSample& /*sample*/, Random& random) {
                             FlipRandomBits(damager, random, bits);
                             damager.Judge();
                           }));
    }
  }
  return all;
}

IntegrityRow AtBitErrorRate(double p, std::int64_t bits, const OfWrongBits& wrong, link::CheckKind kind) {
  IntegrityRow row;
  row.level = p;
  const double probability = kErrorProbability / (kDrawnBitsMax - kEnumeratedBits);
  for (int i = 1; i <= kDrawnBitsMax; ++i) {
    const Counts& counts = wrong.counts[static_cast<std::size_t>(i - 1)];
    row.frames_count += counts.frames;
    row.passed_check_count += counts.passed_check;
    row.delivered_wrong_count += counts.delivered_wrong;
    const double weight = BinomialProbability(bits, i, p);
    const auto add = [&](Rate& rate, std::int64_t count) {
      const Rate own = RateOf(count, counts.frames, probability);
      rate.rate += weight * own.rate;
      rate.low += weight * (i <= kEnumeratedBits ? own.rate : own.low);
      rate.high += weight * (i <= kEnumeratedBits ? own.rate : own.high);
    };
    add(row.passed_check, counts.passed_check);
    add(row.delivered_wrong, counts.delivered_wrong);
  }
  const double beyond = BinomialTail(bits, kDrawnBitsMax, p);
  row.passed_check.high += beyond;
  row.delivered_wrong.high += beyond;
  row.theory = (1 - BinomialProbability(bits, 0, p)) * TheoryOf(kind);
  return row;
}

IntegrityRow RowOf(double level, const Counts& counts) {
  return {.level = level,
          .frames_count = counts.frames,
          .passed_check_count = counts.passed_check,
          .delivered_wrong_count = counts.delivered_wrong,
          .passed_check = RateOf(counts.passed_check, counts.frames, kErrorProbability),
          .delivered_wrong = RateOf(counts.delivered_wrong, counts.frames, kErrorProbability),
          .theory = {}};
}

IntegrityRow AtLevel(const Measurement& measurement, const IntegritySpec& spec, double level) {
  const auto count = static_cast<std::size_t>(level);
  const std::string name = std::string(Name(spec.errors)) + " " + std::to_string(count);
  const auto draw = [&](std::int64_t frames_count, const auto& damage) {
    return RowOf(level, measurement.Draw(name, std::max<std::int64_t>(frames_count, 1), damage));
  };
  switch (spec.errors) {
    case ErrorKind::kBurst: {
      IntegrityRow row = draw(spec.frames_count, [&](Damager& damager, const FrameSample&, Random& random) {
        MakeBurst(damager, random, count);
        damager.Judge();
      });
      row.theory = TheoryOf(measurement.kind());
      return row;
    }
    case ErrorKind::kStuck:
      return draw(spec.frames_count, [&](Damager& damager, const FrameSample&, Random& random) {
        StickBytes(damager, random, count);
        damager.Judge();
      });
    case ErrorKind::kSwap:
      return draw(spec.frames_count, [&](Damager& damager, const FrameSample&, Random& random) {
        SwapBytes(damager, random, count);
        damager.Judge();
      });
    case ErrorKind::kLoss:
    case ErrorKind::kInsert:
      return draw(spec.frames_count / 10, [&](Damager& damager, const FrameSample& sample, Random& random) {
        damager.Judge(OfOtherLength(sample, random, spec.errors == ErrorKind::kInsert, count));
      });
    case ErrorKind::kEnumerate: {
      IntegrityRow row = RowOf(level, measurement.Enumerate(static_cast<int>(count)));
      for (Rate* rate : {&row.passed_check, &row.delivered_wrong}) rate->low = rate->high = rate->rate;
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
               ? "above 0 and at most 0.02"
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

std::vector<IntegrityRow> MeasureIntegrity(const IntegritySpec& spec) {
  const Measurement measurement(spec);
  const std::vector<double> levels = spec.levels.empty() ? LevelsOf(spec.errors) : spec.levels;
  CheckLevels(spec.errors, levels);
  std::vector<IntegrityRow> rows;
  if (spec.errors != ErrorKind::kBer) {
    for (const double level : levels) rows.push_back(AtLevel(measurement, spec, level));
    return rows;
  }
  const OfWrongBits wrong = MeasureWrongBits(measurement, spec.frames_count);
  for (const double level : levels)
    rows.push_back(AtBitErrorRate(level, static_cast<std::int64_t>(measurement.bits_count()), wrong,
                                  measurement.kind()));
  return rows;
}

}  // namespace tiltproof::harness
