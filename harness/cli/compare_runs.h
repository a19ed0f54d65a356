// The part that the views of `compare` share.
#pragma once

#include <string>
#include <vector>

#include "harness/cli/commands.h"

namespace tiltproof::harness {

// Throws UsageError: no flight of A has a partner in B.
[[noreturn]] void RefuseUnpaired(const CompareOptions& options);

// Prints a line of JSON for each of these flights; `letter`: of the run that has them, "a" or "b".
void PrintOnlyIn(const char* letter, const std::vector<std::string>& names);

}  // namespace tiltproof::harness
