// Numbers that a scenario sets for its firmware: the key `firmware_parameters`, among the parameters that the harness
// passes (firmware/tiltproof_client.h).
//
//   double compute_us = 0;
//   const OwnNumber known[] = {{.name = "compute_us", .value = compute_us, .min = 0, .max = 1e6}};
//   const std::string problem = ReadOwnNumbers("{...}", known);   // empty: all are known, and in range
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tiltproof::firmware {

struct OwnNumber {
  std::string_view name;
  double& value;  // stays as it is where the scenario does not set it
  double min, max;
  bool whole = false;
};

// Returns the first number that is unknown or out of range, with what is allowed; empty: there is none. A text without
// the key sets nothing.
std::string ReadOwnNumbers(const char* parameters, std::span<const OwnNumber> known);

}  // namespace tiltproof::firmware
