// The C header of `design-lqr --header`: a design as constants in binary32, for a firmware of any kind.
//
//   file << GainHeader(model, design);   // lqr_gain, lqr_hover_input, lqr_input_min, ...
#pragma once

#include <string>

#include "plant/lqr_design.h"

namespace tiltproof::harness {

// C99 and C++11, without an include. `model` is the one that was designed for.
std::string GainHeader(const plant::VehicleModel& model, const plant::LqrDesign& design);

}  // namespace tiltproof::harness
