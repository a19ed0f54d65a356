#include "faults/random.h"

#include <cmath>

#include "link/check.h"

namespace tiltproof::faults {

constinit thread_local std::uint64_t Random::drawn_count_ = 0;
constinit thread_local std::uint64_t Random::redraw_ = 0;

std::uint64_t StreamKey(std::uint64_t seed, std::initializer_list<std::string_view> names) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  const auto add = [&hash](std::uint8_t byte) { hash = (hash ^ byte) * 0x100000001b3ULL; };
  for (int shift = 0; shift < 64; shift += 8) add(static_cast<std::uint8_t>(seed >> shift & 0xFF));
  for (const std::string_view name : names) {
    for (const char c : name) add(static_cast<std::uint8_t>(c));
    add(0);
  }
  return hash;
}

bool Random::Bernoulli(double probability) {
  const std::uint64_t draw = (*this)();
  if (!(probability > 0.0)) return false;
  if (probability >= 1.0) return true;
  return draw < static_cast<std::uint64_t>(std::ldexp(probability, 64));
}

std::uint64_t Random::Below(std::uint64_t n) {
  Check(n > 0, "a number is drawn from a range with numbers in it");
  // The last, incomplete run of n values is refused.
  const std::uint64_t refused_from = max() - (max() % n + 1) % n;
  std::uint64_t draw = (*this)();
  while (draw > refused_from) draw = (*this)();
  return draw % n;
}

std::uint64_t Random::FailuresBefore(double probability) {
  const double u = Uniform();
  if (!(probability > 0.0)) return kManyFailures;
  if (probability >= 1.0) return 0;
  const double failures = std::floor(std::log1p(-u) / std::log1p(-probability));
  return failures < static_cast<double>(kManyFailures) ? static_cast<std::uint64_t>(failures) : kManyFailures;
}

double Random::Exponential() { return -std::log1p(-Uniform()); }

}  // namespace tiltproof::faults
