// Comparisons of two runs: `tiltproof compare` by itself, with --baseline and with --outcomes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tiltproof::harness {

struct CompareOptions {
  std::filesystem::path a, b;
  double tolerance = 1e-3;
  std::string format = "human";
  bool anyway = false;  // compares different flights, too
};
// --baseline: compares results alone, and reports where b is worse than a. The tolerance is that of margins.
int BaselineCommand(const CompareOptions& options);
// --outcomes: a is the run of one flight, the reference.
int OutcomesCommand(const CompareOptions& options);

// Throws UsageError: no flight of A has a partner in B.
[[noreturn]] void RefuseUnpaired(const CompareOptions& options);

// Prints a line of JSON for each of these flights; `letter`: of the run that has them, "a" or "b".
void PrintOnlyIn(const char* letter, const std::vector<std::string>& names);

}  // namespace tiltproof::harness
