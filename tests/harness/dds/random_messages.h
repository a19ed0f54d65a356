// Messages with random content, the same for the same seed in every process; and the largest that can be sent.
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "harness/dds/messages.h"

namespace tiltproof::dds {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::uint64_t Below(std::uint64_t limit) { return engine_() % limit; }
  std::int64_t Integer() { return static_cast<std::int64_t>(engine_()); }
  // Any number but NaN, which equals nothing.
  double Number();
  // Empty, as long as possible, or between; any bytes but NUL.
  std::string Text(std::size_t bytes_max);
  std::vector<std::uint8_t> Bytes(std::size_t count_max);
  // 0, 1, or a few; sometimes the limit.
  std::size_t Count(std::size_t limit);

 private:
  std::mt19937_64 engine_;
};

// Keys differ for different `index`, so that no message replaces another one.
template <class T>
T RandomMessage(Random& random, int index);

// Every string and list of it as long as it can be, as far as that is less than some megabytes.
template <class T>
T LargestMessage();

}  // namespace tiltproof::dds
