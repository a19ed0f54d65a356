// Which scenarios a command is about: the files behind its PATHs, and the narrowing by -k and --tag.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Scenario files behind PATHs: a file stands for itself, a folder for every *.yaml and *.yml below it,
// sorted. A file that two paths lead to is listed once. Throws std::invalid_argument when a path does not
// exist.
std::vector<std::filesystem::path> FindScenarios(const std::vector<std::filesystem::path>& paths);

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
