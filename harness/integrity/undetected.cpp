#include "harness/integrity/undetected.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "harness/integrity/binomial.h"
#include "harness/integrity/check_group.h"

namespace tiltproof::harness {
namespace {

using link::CheckKind;

// Weights that are counted for checks of 16 bits and less. There every character of the check's group can be summed.
constexpr int kWeightMax = 6;
using Polynomial = std::array<double, kWeightMax + 1>;  // [k]: the factor of z^k

Polynomial Product(const Polynomial& a, const Polynomial& b) {
  Polynomial product{};
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; i + j < a.size(); ++j) product[i + j] += a[i] * b[j];
  return product;
}

double Choose(double n, int k) {
  double ways = 1;
  for (int i = 0; i < k; ++i) ways *= (n - i) / (i + 1);
  return ways;
}

std::vector<std::uint32_t> BitSyndromes(const CheckGroup& group) {
  std::vector<std::uint32_t> syndromes;
  for (std::size_t place = 0; place < group.content_bytes(); ++place)
    for (int bit = 0; bit < 8; ++bit)
      syndromes.push_back(
          static_cast<std::uint32_t>(group.Change(place, 0, static_cast<std::uint8_t>(1 << bit))));
  return syndromes;
}

// A CRC of 16 bits. A character of its group is a set u of syndrome bits: a wrong bit counts -1 when it changes an odd
// number of them. The patterns of weight k that pass are the mean over all u of the z^k of (1 - z)^w (1 + z)^(n - w),
// with the number w of such bits (MacWilliams, Bell System Technical Journal 42(1), 1963, 79).
std::vector<double> OfCrc16(const CheckGroup& group) {
  constexpr std::size_t kSize = 1 << 16;
  std::vector<double> sums(kSize);
  const std::vector<std::uint32_t> syndromes = BitSyndromes(group);
  for (const std::uint32_t syndrome : syndromes) sums[syndrome] += 1;
  // Walsh-Hadamard transform: sums[u] becomes n - 2 w(u).
  for (std::size_t step = 1; step < kSize; step *= 2)
    for (std::size_t i = 0; i < kSize; ++i)
      if ((i & step) == 0) {
        const double a = sums[i], b = sums[i + step];
        sums[i] = a + b;
        sums[i + step] = a - b;
      }
  const auto n = static_cast<double>(syndromes.size());
  std::vector<double> counts(kWeightMax + 1);
  for (const double sum : sums) {
    // Krawtchouk's polynomials: (k + 1) K(k + 1) = (n - 2 w) K(k) - (n - k + 1) K(k - 1).
    double before = 0, now = 1;
    for (int k = 0; k <= kWeightMax; ++k) {
      counts[static_cast<std::size_t>(k)] += now / kSize;
      const double next = (sum * now - (n - k + 1) * before) / (k + 1);
      before = now;
      now = next;
    }
  }
  for (double& count : counts) count = std::round(count);
  return counts;
}

// The mean effect of one wrong byte on a character of the sums, by the number of its wrong bits: each adds or takes away
// its value, as the data have it, m times. [m]
std::vector<Polynomial> ByteFactors(std::uint32_t modulus) {
  std::vector<Polynomial> factors(modulus);
  for (std::uint32_t m = 0; m < modulus; ++m) {
    factors[m][0] = 1;
    for (int bit = 0; bit < 8; ++bit) {
      const double angle = 2 * std::numbers::pi * static_cast<double>((m << bit) % modulus) / modulus;
      factors[m] = Product(factors[m], {1, std::cos(angle)});
    }
  }
  return factors;
}

std::vector<double> Mean(const Polynomial& sum, double count, std::size_t bits_count) {
  std::vector<double> counts;
  for (int k = 0; k <= kWeightMax; ++k) {
    const double mean = sum[static_cast<std::size_t>(k)] / count;
    // Rounding errors of numbers that make up for one another.
    const double rounding = 1e-13 * Choose(static_cast<double>(bits_count), k);
    counts.push_back(mean > rounding ? mean : 0);
  }
  return counts;
}

std::vector<double> OfSum8(const CheckGroup& group) {
  Polynomial sum{};
  for (const Polynomial& factor : ByteFactors(group.modulus())) {
    Polynomial product = {1};
    for (std::size_t i = 0; i < group.content_bytes(); ++i) product = Product(product, factor);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += product[k];
  }
  return Mean(sum, group.modulus(), 8 * group.content_bytes());
}

// Characters of Fletcher's pair of sums: (a, b). A byte counts a + b w, with its distance w to the end of the payload.
std::vector<double> OfFletcher(const CheckGroup& group) {
  const std::uint32_t modulus = group.modulus();
  const std::vector<Polynomial> factors = ByteFactors(modulus);
  Polynomial sum{};
  // (-a, -b) has the same product as (a, b).
  for (std::uint32_t b = 0; b <= modulus / 2; ++b) {
    const double times = b == 0 ? 1 : 2;
    for (std::uint32_t a = 0; a < modulus; ++a) {
      Polynomial product = Product(factors[a], factors[b]);  // of the check's bytes
      for (std::uint32_t w = 1; w <= group.payload_bytes(); ++w)
        product = Product(product, factors[(a + b * w) % modulus]);
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += times * product[k];
    }
  }
  return Mean(sum, static_cast<double>(modulus) * modulus, 8 * group.content_bytes());
}

// CRC-32 has too many characters. It has a Hamming distance of at least 4 at these lengths, so patterns of 4 and 5 bits
// are pairs of patterns of 2 and 3 bits without a common one.
std::vector<double> OfCrc32(const CheckGroup& group) {
  constexpr std::size_t kTriplesBitsMax = 1300;
  constexpr int kFilterBits = 24;
  const std::vector<std::uint32_t> syndromes = BitSyndromes(group);
  const std::size_t n = syndromes.size();
  std::vector<std::uint32_t> pairs;
  pairs.reserve(n * (n - 1) / 2);
  std::vector<bool> filter(std::size_t{1} << kFilterBits);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j) {
      pairs.push_back(syndromes[i] ^ syndromes[j]);
      filter[pairs.back() >> (32 - kFilterBits)] = true;
    }
  std::sort(pairs.begin(), pairs.end());
  const auto equal_pairs = [&](std::uint32_t syndrome) {
    if (!filter[syndrome >> (32 - kFilterBits)]) return 0.0;
    const auto [from, to] = std::equal_range(pairs.begin(), pairs.end(), syndrome);
    return static_cast<double>(to - from);
  };
  double fours = 0, fives = 0;
  for (const std::uint32_t pair : pairs) fours += equal_pairs(pair) - 1;
  std::vector<double> counts = {1, 0, 0, 0, fours / 6};
  if (n > kTriplesBitsMax) return counts;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j)
      for (std::size_t k = j + 1; k < n; ++k)
        fives += equal_pairs(syndromes[i] ^ syndromes[j] ^ syndromes[k]);
  counts.push_back(fives / 10);
  return counts;
}

std::vector<double> CountsOf(const CheckGroup& group) {
  switch (group.kind()) {
    case CheckKind::kFletcher16:
      return OfFletcher(group);
    case CheckKind::kCrc16Ibm3740:
    case CheckKind::kCrc16IbmSdlc:
      return OfCrc16(group);
    case CheckKind::kCrc32IsoHdlc:
      return OfCrc32(group);
    case CheckKind::kSum8:
      return OfSum8(group);
    case CheckKind::kNone:
      break;
  }
  return {1};
}

}  // namespace

UndetectedErrors::UndetectedErrors(CheckKind kind, std::size_t content_bytes)
    : bits_count_(8 * content_bytes),
      share_beyond_(std::exp2(-8.0 * static_cast<double>(link::CheckBytes(kind)))),
      counts_(CountsOf(CheckGroup(kind, content_bytes))) {}

double UndetectedErrors::Count(int weight) const {
  if (weight <= weight_max()) return counts_[static_cast<std::size_t>(weight)];
  return share_beyond_ * Choose(static_cast<double>(bits_count_), weight);
}

int UndetectedErrors::HammingDistance() const {
  if (weight_max() == 0) return 1;
  for (int weight = 1; weight <= weight_max(); ++weight)
    if (Count(weight) > 0) return weight;
  return 0;
}

double UndetectedErrors::RateAt(double p) const {
  const auto bits = static_cast<std::int64_t>(bits_count_);
  double rate = share_beyond_ * BinomialTail(bits, std::min<std::int64_t>(weight_max(), bits), p);
  for (int weight = 1; weight <= std::min<std::int64_t>(weight_max(), bits); ++weight)
    rate += Count(weight) / Choose(static_cast<double>(bits_count_), weight) *
            BinomialProbability(bits, weight, p);
  return rate;
}

}  // namespace tiltproof::harness
