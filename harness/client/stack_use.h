// Use of a stack of the firmware.
#pragma once

#include <cstdint>
#include <string>

#include "link/fields.h"

namespace tiltproof::harness {

struct StackUse {
  std::string name;  // `main`, or the variable's
  std::int64_t size_bytes = 0;
  std::int64_t used_bytes_max = 0;
  bool overflowed = false;
  friend bool operator==(const StackUse&, const StackUse&) = default;
  TILTPROOF_FIELDS(name, size_bytes, used_bytes_max, overflowed)
};

}  // namespace tiltproof::harness
