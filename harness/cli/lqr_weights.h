// The file of `design-lqr --weights`: weights of the cost by the names of states, integrals and inputs.
//
//   x_m: 5              # YAML, or in a file ending in .csv: x_m,5
//   f_front_left_n: 25
//
//   LqrWeights weights = ReadLqrWeights(file, model, defaults);
#pragma once

#include <filesystem>

#include "plant/lqr_design.h"

namespace tiltproof::harness {

// A name that the file lacks keeps its value in `defaults`. Throws UsageError with the place of every mistake.
plant::LqrWeights ReadLqrWeights(const std::filesystem::path& file, const plant::VehicleModel& model,
                                 plant::LqrWeights defaults);

}  // namespace tiltproof::harness
