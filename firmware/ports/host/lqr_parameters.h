// The numbers and the protocol of the build `lqr`, and the place of a board among several, from the parameters that the
// harness passes (firmware/tiltproof_client.h).
//
//   LqrSetup setup;
//   const bool complete = ReadLqrSetup("{...}", setup);
#pragma once

#include "firmware/lqr/lqr_application.h"

namespace tiltproof::firmware {

// 0 when the text is none, or says nothing of it.
std::size_t ReadPlace(const char* parameters);

// False when the text is none, lacks a gain or a protocol with all states, or has other sizes than a vehicle of this
// build. `setup` is then in an unspecified state.
bool ReadLqrSetup(const char* parameters, LqrSetup& setup);

}  // namespace tiltproof::firmware
