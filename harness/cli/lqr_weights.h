// The file of `design-lqr --weights`: weights of the cost by the names of states, integrals and inputs.
//
// A line of YAML is "x_m: 5"; in a file that ends in .csv it is "x_m,5". Read by ReadLqrWeights().
#pragma once

#include <filesystem>

#include "plant/lqr_design.h"

namespace tiltproof::harness {

// A name that the file lacks keeps its value in `defaults`. Throws UsageError with the place of every mistake.
plant::LqrWeights ReadLqrWeights(const std::filesystem::path& file, const plant::VehicleModel& model,
                                 plant::LqrWeights defaults);

}  // namespace tiltproof::harness
