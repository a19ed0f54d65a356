// The randomness of faults: one seed, one stream per fault and purpose, one generator per frame.
//
// A generator is made from a 64-bit key: StreamKey(seed, fault id, purpose, ...) names the stream and
// KeyOf(stream, n) the n-th frame (or second, or sample) in it. So what a fault draws for frame n depends
// only on the seed, its own id and n. Neither adding or removing another fault nor an earlier frame shifts
// it.
//
//   Random random(KeyOf(StreamKey(7, {"bursts", "model"}), frame_number));
//   if (random.Bernoulli(0.1)) ...
//
// The key of a stream is FNV-1a (64 bits; Fowler, Noll, Vo) over the seed's eight bytes, low byte first, and
// then the bytes of each name followed by a zero byte. The generator is SplitMix64 (Steele, Lea, Flood 2014,
// "Fast splittable pseudorandom number generators"): it has no state to warm up, which matters for a
// generator that is used for only one frame. Its numbers are the same on every platform: Uniform() takes 53
// bits, a Bernoulli draw compares integers.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <limits>
#include <string_view>

namespace tiltproof::faults {

// SplitMix64's output function: a bijection of 64-bit numbers that spreads every bit of x.
constexpr std::uint64_t Mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

std::uint64_t StreamKey(std::uint64_t seed, std::initializer_list<std::string_view> names);

// The key of the n-th generator of a stream.
constexpr std::uint64_t KeyOf(std::uint64_t stream, std::uint64_t n) {
  return Mix(stream + Mix(n + 0x9e3779b97f4a7c15ULL));
}

// Meets the requirements of the standard's uniform random bit generator.
class Random {
 public:
  using result_type = std::uint64_t;
  explicit Random(std::uint64_t key) : state_(key ^ redraw_) {}

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return std::numeric_limits<result_type>::max(); }
  result_type operator()() {
    ++drawn_count_;
    return Mix(state_ += 0x9e3779b97f4a7c15ULL);
  }

  // The count of numbers that this thread has drawn from all generators. A flight that drew none is the same for every
  // seed.
  static std::uint64_t DrawnCount() { return drawn_count_; }

  // From now on, this thread's new generators draw other numbers: those of `future`. 0: the numbers of their keys. A flight
  // that is continued with other chances uses it (harness/run/future.h).
  static void Redraw(std::uint64_t future) { redraw_ = future; }

  // In [0, 1), a multiple of 2^-53.
  double Uniform() { return static_cast<double>((*this)() >> 11) * 0x1p-53; }
  // True with the given probability, to within 2^-53; always one draw; never true at <= 0, always true at >=
  // 1.
  bool Bernoulli(double probability);
  // In [0, n), every value equally likely; n > 0.
  std::uint64_t Below(std::uint64_t n);
  // The number of Bernoulli draws that fail before the first success, in one draw. It is kManyFailures when none would
  // succeed within that number (so always for probability 0).
  static constexpr std::uint64_t kManyFailures = std::uint64_t{1} << 62;
  std::uint64_t FailuresBefore(double probability);
  // Time to the next event of a Poisson process of that rate, in units of 1/rate.
  double Exponential();
  // A number with mean 0 and standard deviation 1; one draw or several (faults/standard_normal.cpp).
  double StandardNormal();

 private:
  static constinit thread_local std::uint64_t drawn_count_, redraw_;
  std::uint64_t state_;
};

}  // namespace tiltproof::faults
