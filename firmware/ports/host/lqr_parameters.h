// The numbers of the build `lqr`, from the parameters that the harness passes (firmware/tiltproof_client.h).
//
//   LqrTable table;
//   const bool complete = ReadLqrTable("{...}", table);
#pragma once

#include "firmware/lqr/lqr_law.h"

namespace tiltproof::firmware {

// False when the text is none, lacks a gain, or has other sizes than a vehicle of this build. `table` is then in an
// unspecified state.
bool ReadLqrTable(const char* parameters, LqrTable& table);

}  // namespace tiltproof::firmware
