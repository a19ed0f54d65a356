#include "harness/integrity/damager.h"

#include <algorithm>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

using faults::Random;

// In [0, n), every value equally likely; n > 0 (D. Lemire, Fast Random Integer Generation in an Interval, ACM
// Transactions on Modeling and Computer Simulation 29(1), 2019). Random::Below() divides, which takes too long here.
std::size_t Below(Random& random, std::size_t n) {
  const auto draw = [&] { return (random() >> 32) * n; };
  std::uint64_t product = draw();
  if (static_cast<std::uint32_t>(product) < n) {
    const std::uint64_t refused_below = (std::uint64_t{1} << 32) % n;
    while (static_cast<std::uint32_t>(product) < refused_below) product = draw();
  }
  return product >> 32;
}

}  // namespace

Counts& Counts::operator+=(const Counts& other) {
  frames += other.frames;
  passed_check += other.passed_check;
  passed_length += other.passed_length;
  delivered_wrong += other.delivered_wrong;
  return *this;
}

Damager::Damager(const FrameSample& sample, const CheckGroup& group)
    : group_(group),
      receiver_(sample),
      wire_(sample.wire().begin(), sample.wire().end()),
      damaged_(wire_),
      effects_(256 * wire_.size()),
      bit_effects_(8 * wire_.size()),
      marks_count_(sample.Marks().size()),
      is_touched_(wire_.size()) {
  Check(sample.content().size() == group.content_bytes(), "a group is that of a frame's content");
  places_.reserve(wire_.size());
  for (std::size_t value = 0; value < asks_.size(); ++value)
    if (sample.IsSpecial(static_cast<std::uint8_t>(value))) asks_[value] = kAsk;
  for (std::size_t place = 0; place < wire_.size(); ++place) {
    const std::size_t in_content = sample.ContentPlace(place);
    const std::uint8_t from = in_content == FrameSample::kNone ? 0 : sample.content()[in_content];
    for (std::uint32_t value = 0; value < 256; ++value) {
      std::uint64_t& effect = effects_[256 * place + value];
      const auto byte = static_cast<std::uint8_t>(value);
      if (byte == wire_[place]) continue;
      effect = in_content == FrameSample::kNone || sample.IsSpecial(byte)
                   ? kAsk
                   : group.Change(in_content, from, static_cast<std::uint8_t>(from ^ byte ^ wire_[place]));
    }
    if (place == 0 && sample.IsBetweenFlags())
      for (std::uint32_t value = 0; value < 256; ++value)
        if (const auto byte = static_cast<std::uint8_t>(value); byte != wire_[0] && !sample.IsSpecial(byte))
          effects_[value] = group.InFront(byte);
    for (std::size_t bit = 0; bit < 8; ++bit)
      bit_effects_[8 * place + bit] = EffectOf(place, static_cast<std::uint8_t>(wire_[place] ^ 1U << bit));
  }
  added_effects_ = bit_effects_;
  std::fill_n(added_effects_.begin(), 8 * marks_count_, 0);
  if (sample.IsBetweenFlags()) Lengthen(sample);
}

// Effects of the frame whose closing flag is taken for a byte of the content.
void Damager::Lengthen(const FrameSample& sample) {
  std::vector<std::uint8_t> content(sample.content().begin(), sample.content().end());
  content.push_back(wire_.back());
  longer_.emplace(group_.kind(), content.size());
  longer_effect_ = longer_->Of(content);
  longer_effects_.resize(8 * wire_.size());
  for (std::size_t place = 1; place < wire_.size(); ++place) {
    const bool is_last = place + 1 == wire_.size();
    const std::size_t in_content = is_last ? content.size() - 1 : sample.ContentPlace(place);
    if (in_content == FrameSample::kNone) continue;
    for (std::size_t bit = 0; bit < 8; ++bit) {
      const auto mask = static_cast<std::uint8_t>(1U << bit);
      longer_effects_[8 * place + bit] = longer_->Change(
          in_content, content[in_content], static_cast<std::uint8_t>(content[in_content] ^ mask));
    }
  }
  std::fill_n(added_effects_.begin(), 8, 0);
  std::fill_n(added_effects_.end() - 8, 8, 0);
}

void Damager::MakeBurst(Random& random, std::size_t length) {
  length = std::min(length, bits_count());
  const std::size_t first = Below(random, bits_count() - length + 1);
  for (std::size_t i = 0; i < length;) {
    // All bits of one byte at once.
    const std::size_t in_byte = (first + i) % 8, count = std::min(8 - in_byte, length - i);
    std::uint32_t bits = static_cast<std::uint32_t>(random() >> 56) & ((1U << count) - 1);
    if (i == 0) bits |= 1;
    if (i + count == length) bits |= 1U << (count - 1);
    const std::size_t place = (first + i) / 8;
    if (bits != 0) Set(place, damaged_[place] ^ bits << in_byte);
    i += count;
  }
}

void Damager::StickBytes(Random& random, std::size_t count) {
  count = std::min(count, wire_.size());
  const std::uint8_t stuck = (random() >> 63) != 0 ? 0xFF : 0x00;
  const std::size_t first = Below(random, wire_.size() - count + 1);
  for (std::size_t i = first; i < first + count; ++i) Set(i, stuck);
}

void Damager::SwapBytes(Random& random, std::size_t count) {
  if (wire_.size() < 2) return;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t first = Below(random, wire_.size() - 1);
    const std::uint8_t byte = damaged_[first];
    Set(first, damaged_[first + 1]);
    Set(first + 1, byte);
  }
}

bool Damager::MayPass() const {
  std::uint64_t total = 0, any = 0;
  bool is_changed = false;
  for (const std::uint32_t place : places_) {
    const std::uint64_t effect = EffectOf(place, damaged_[place]);
    total = group_.Add(total, effect);
    any |= effect;
    is_changed = is_changed || damaged_[place] != wire_[place];
  }
  return (any & kAsk) != 0 || (is_changed && group_.MayHold(total));
}

Received Damager::Add(const Received& received) {
  ++counts_.frames;
  counts_.passed_check += received.passed_check_count;
  counts_.passed_length += received.passed_length_count;
  counts_.delivered_wrong += received.accepted_count;
  return received;
}

Received Damager::Judge() {
  Received received;
  if (MayPass()) received = receiver_.Receive(damaged_);
  for (const std::uint32_t place : places_) {
    damaged_[place] = wire_[place];
    is_touched_[place] = false;
  }
  places_.clear();
  return Add(received);
}

// Wrong bits of one byte have the sum of their effects, for a sum of bytes, too: each bit adds or takes a power of two.
Received Damager::JudgeWithWrongBits(Random& random, std::size_t count) {
  other_ = wire_;
  wrong_bits_.resize(count);
  std::uint64_t total = 0, any = 0;
  // A byte that is written may be a part of any member, for the compiler. So the loop reads copies, of CheckGroup::Add(),
  // too.
  std::uint8_t* const bytes = other_.data();
  const std::uint8_t* const wire = wire_.data();
  const std::uint64_t* const effects = added_effects_.data();
  std::uint32_t* const wrong_bits = wrong_bits_.data();
  const bool is_linear = group_.is_linear();
  const std::uint64_t n = bits_count();
  for (std::size_t done = 0; done < count;) {
    // Two draws from one number, each as in Below().
    for (std::uint64_t drawn = random(), half = 0; half < 2 && done < count; ++half, drawn >>= 32) {
      const std::uint64_t product = (drawn & 0xFFFFFFFF) * n;
      const auto low = static_cast<std::uint32_t>(product);
      if (low < n && low < (std::uint64_t{1} << 32) % n) continue;
      const std::size_t bit = product >> 32, place = bit / 8;
      const auto mask = static_cast<std::uint8_t>(1U << bit % 8);
      if (((bytes[place] ^ wire[place]) & mask) != 0) continue;
      bytes[place] ^= mask;
      total = is_linear ? total ^ effects[bit] : total + effects[bit];
      any |= effects[bit] | asks_[bytes[place]];
      wrong_bits[done++] = static_cast<std::uint32_t>(bit);
    }
  }
  return Add(MayPass(wrong_bits_, total, any) ? receiver_.Receive(other_) : Received());
}

bool Damager::MayPass(std::span<const std::uint32_t> bits, std::uint64_t total, std::uint64_t any) const {
  if (bits.empty()) return false;
  // Without its marks, a receiver waits for the next frame, unless it finds some in the content.
  if (!std::equal(wire_.begin(), wire_.begin() + static_cast<std::ptrdiff_t>(marks_count_), other_.begin()))
    return std::find(other_.begin() + 1, other_.end(), wire_[0]) != other_.end();
  if ((any & kAsk) != 0) return true;
  if (!longer_) return group_.MayHold(total);
  const bool is_opened = other_.front() == wire_.front(), is_closed = other_.back() == wire_.back();
  const CheckGroup& group = is_closed ? group_ : *longer_;
  if (!is_closed) {
    total = longer_effect_;
    for (const std::uint32_t bit : bits) total = group.Add(total, longer_effects_[bit]);
  }
  if (!is_opened) total = group.Add(total, group.InFront(other_.front()));
  return group.MayHold(total);
}

Received Damager::JudgeWithLost(Random& random, std::size_t count) {
  other_ = wire_;
  for (std::size_t i = 0; i < count && !other_.empty(); ++i)
    other_.erase(other_.begin() + static_cast<std::ptrdiff_t>(Below(random, other_.size())));
  return Add(receiver_.Receive(other_));
}

Received Damager::JudgeWithAdded(Random& random, std::size_t count) {
  other_ = wire_;
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = other_.begin() + static_cast<std::ptrdiff_t>(Below(random, other_.size() + 1));
    other_.insert(at, static_cast<std::uint8_t>(random() >> 56));
  }
  return Add(receiver_.Receive(other_));
}

void Damager::JudgeAllFrom(std::size_t first, int count) {
  FlipBit(first);
  if (count == 1) {
    Judge();
    return;
  }
  if (count == 2) {
    JudgeLastBit(first + 1);
  } else {
    for (std::size_t second = first + 1; second < bits_count(); ++second) {
      FlipBit(second);
      JudgeLastBit(second + 1);
      FlipBit(second);
    }
  }
  for (const std::uint32_t place : places_) {
    damaged_[place] = wire_[place];
    is_touched_[place] = false;
  }
  places_.clear();
}

// Adds the last wrong bit, in all its ways. In a byte of its own, it must have the one effect that makes up for those
// of the others.
void Damager::JudgeLastBit(std::size_t from) {
  std::uint64_t total = 0, any = 0;
  for (const std::uint32_t place : places_) {
    const std::uint64_t effect = EffectOf(place, damaged_[place]);
    total = group_.Add(total, effect);
    any |= effect;
  }
  const std::uint64_t missing = (any & kAsk) != 0 ? kAsk : group_.Missing(total);
  const std::size_t own_byte_from = std::min((from + 7) / 8 * 8, bits_count());
  counts_.frames += static_cast<std::int64_t>(bits_count() - from);
  for (std::size_t bit = from; bit < bits_count(); ++bit) {
    const std::uint64_t effect = bit_effects_[bit];
    if (bit >= own_byte_from && effect != missing && (effect & kAsk) == 0 && missing != kAsk) continue;
    damaged_[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
    const Received received = receiver_.Receive(damaged_);
    damaged_[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
    counts_.passed_check += received.passed_check_count;
    counts_.passed_length += received.passed_length_count;
    counts_.delivered_wrong += received.accepted_count;
  }
}

}  // namespace tiltproof::harness
