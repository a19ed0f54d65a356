// The finite range from which values of a field are made up.
//
//   const FieldRange range = MadeUpRange(field);
//   const double value = range.min + (range.max - range.min) * random.Uniform();
#pragma once

#include <algorithm>

#include "link/protocol.h"

namespace tiltproof::faults {

struct FieldRange {
  double min = 0.0, max = 0.0;
};

// The field's plausible range; where this has no end, up to what a small aircraft's values reach, and the field can hold.
inline FieldRange MadeUpRange(const link::MessageField& field) {
  constexpr double kReach = 1e4;
  const double least = field.scale * link::LeastNumber(field.type);
  const double largest = field.scale * link::LargestNumber(field.type);
  return {std::max({field.min, std::min(-kReach, field.max), least}),
          std::min({field.max, std::max(kReach, field.min), largest})};
}

}  // namespace tiltproof::faults
