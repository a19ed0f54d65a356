// A direction as a parameter of a fault.
#pragma once

#include <array>
#include <cmath>
#include <string_view>

#include "faults/parameters.h"

namespace tiltproof::faults {

// `direction`: [x, y, z], not all zero.
inline ParameterInfo DirectionParameter(std::string_view doc, const std::array<double, 3>& example) {
  return {.name = "direction",
          .unit = "1",
          .kind = ParameterKind::kVector,
          .min = -1e3,
          .max = 1e3,
          .doc = doc,
          .example = example};
}

// A vector of that length along `direction`.
inline std::array<double, 3> AlongDirection(const Parameters& parameters, double length) {
  const auto& direction = parameters.Vector("direction");
  const double norm = std::hypot(std::hypot(direction[0], direction[1]), direction[2]);
  std::array<double, 3> vector{};
  for (std::size_t i = 0; i < vector.size(); ++i) vector[i] = length * direction[i] / norm;
  return vector;
}

}  // namespace tiltproof::faults
