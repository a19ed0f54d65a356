// Selects the scenarios of a command: the files behind its PATHs, narrowed by -k and --tag.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

struct FoundScenarios {
  struct File {
    std::filesystem::path path;
    bool named = false;  // on the command line; otherwise found in a folder
  };
  std::vector<File> files;            // each once, even if several paths lead to it
  std::vector<std::string> problems;  // arguments that are no file: they would be tests that never fly
  std::vector<std::string> warnings;  // links that were not followed

  std::vector<std::filesystem::path> Paths() const;
};

// Scenario files behind PATHs: a file is itself, a folder is every *.yaml and *.yml file below it, sorted, that is no
// protocol file. Links are followed, but not in circles. Folders with results of runs are left out: they hold resolved
// scenarios, which are not the user's.
FoundScenarios FindScenarios(const std::vector<std::filesystem::path>& paths);

// Name of the folder, or of the file without its ending; for several paths the names, joined by '+',
// or the first one and the number of the others when that is long.
std::string SuiteName(const std::vector<std::filesystem::path>& paths);

// -k EXPR --tag TAG. EXPR is words joined by `and`, `or`, `not` and parentheses; a word holds when the
// scenario's name or one of its tags contains it, whatever the case. Empty texts select everything.
class Selection {
 public:
  // Throws std::invalid_argument with the column when the expression is malformed.
  explicit Selection(std::string_view expression = {}, std::string_view tag = {});
  bool Matches(const Scenario& scenario) const;

  struct Node;

 private:
  std::shared_ptr<const Node> expression_;
  std::string tag_;
};

}  // namespace tiltproof::harness
