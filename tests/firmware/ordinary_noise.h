// The noise of ordinary sensors (docs/tolerant.md), for tests:
//
//   std::mt19937 engine(1);
//   x_m += kOrdinaryNoise[0] * NearlyNormal(engine);
#pragma once

#include <array>
#include <random>

#include "firmware/signals.h"

namespace tiltproof::firmware {

// Standard deviations, in the order of kSensorFields.
inline constexpr std::array<float, kSensorCount> kOrdinaryNoise = {2e-3F, 2e-3F, 2e-3F, 1e-3F, 1e-3F, 1e-3F,
                                                                   1e-3F, 1e-3F, 1e-2F, 1e-2F, 1e-2F, 1e-2F,
                                                                   1e-2F, 1e-2F, 3e-2F, 3e-2F};

// Twelve uniform numbers in [0, 1] minus 6: mean 0, variance 1, nearly normal.
inline float NearlyNormal(std::mt19937& engine) {
  float sum = -6;
  for (int i = 0; i < 12; ++i) sum += static_cast<float>(engine()) * 0x1p-32F;
  return sum;
}

}  // namespace tiltproof::firmware
