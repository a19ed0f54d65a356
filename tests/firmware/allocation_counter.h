// Counts the process's calls of operator new, those from libraries loaded at run time included, when linked
// in.
#pragma once

#include <cstddef>

namespace tiltproof::firmware {

std::size_t AllocationCount();

}  // namespace tiltproof::firmware
