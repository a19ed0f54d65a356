// Everything that has arrived on a wire, as a test looks at it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "link/wire.h"

namespace tiltproof::link {

struct Taken {
  BootTime arrival;
  std::vector<std::uint8_t> bytes;
  friend bool operator==(const Taken&, const Taken&) = default;
};

inline std::vector<Taken> TakeAll(Wire& wire, BootTime until = BootTime::Never()) {
  std::vector<Taken> all;
  wire.Take(until, [&all](BootTime arrival, std::span<const std::uint8_t> bytes) {
    all.push_back({arrival, {bytes.begin(), bytes.end()}});
  });
  return all;
}

}  // namespace tiltproof::link
