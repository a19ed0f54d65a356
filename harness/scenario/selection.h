// Which scenarios a command is about: the files behind its PATHs, and the narrowing by -k and --tag.
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
    bool named = false;  // on the command line, else found in a folder
  };
  std::vector<File> files;  // each once, however many paths lead to it
  std::vector<std::string>
      problems;  // what was asked for and is no file: it would be a test that never flies
  std::vector<std::string> warnings;  // links that were not followed

  std::vector<std::filesystem::path> Paths() const;
};

// Scenario files behind PATHs: a file stands for itself, a folder for every *.yaml and *.yml below it, sorted.
// Links are followed, but not in circles. Results of runs hold resolved scenarios, which are not the user's:
// their folders are left out.
FoundScenarios FindScenarios(const std::vector<std::filesystem::path>& paths);

// Name of the folder, or of the file without its ending; of several paths, joined by '+', or the
// first and how many more when that is long.
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
