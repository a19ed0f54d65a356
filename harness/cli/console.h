// Output for a person on standard output.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "harness/report/repeats.h"
#include "harness/report/results.h"

namespace tiltproof::harness {

class Console {
 public:
  // Colours only on a terminal, and only if NO_COLOR is unset (no-color.org).
  explicit Console(bool jsonl);

  // On a terminal no line has more than 80 columns, unless a path or a name is longer.
  void Line(const std::string& text) const;  // human format only
  // Prints one finished scenario: one line of at most 80 columns on a terminal. For every scenario that did
  // not simply pass: what failed, when, and by how much. When it is not green: all that failed, the seed, and
  // the command that flies it again.
  void Finished(const FlightResult& result) const;
  // Prints the scenarios that cannot be flown: by reason for a person, each on standard error for a script.
  void LeftOut(const std::vector<NotApplicable>& scenarios) const;
  // Prints the repeats of each scenario that was flown with several seeds.
  void Repeated(const std::vector<Repeats>& scenarios) const;
  // The last line: how many are green, and where the report is.
  void Summary(const std::vector<FlightResult>& results, std::size_t not_flown_count,
               std::size_t not_applicable_count, bool interrupted,
               const std::optional<std::filesystem::path>& report = std::nullopt) const;

 private:
  std::string Paint(const char* colour, const std::string& text) const;
  // A command that flies something again, behind what it is for.
  void Again(const std::string& what, const std::string& command) const;
  std::string FlightLine(const FlightResult& result) const;
  bool jsonl_;
  bool terminal_;
  std::size_t indent_;  // of what stands below a flight's line
  bool colours_;
};

}  // namespace tiltproof::harness
