// Errors in the files that users write, each with its place.
#pragma once

#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

struct Diagnostic {
  std::filesystem::path file;
  int line = 0, column = 0;  // 1-based, in characters; line 0: about the file as a whole
  std::string message;
};
// "file:line:column: message".
std::string ToString(const Diagnostic& diagnostic);

// All errors, by file and place, at most kDiagnosticsMax per file; what() has one line for each.
class ScenarioError : public std::runtime_error {
 public:
  explicit ScenarioError(std::vector<Diagnostic> diagnostics);
  const std::vector<Diagnostic>& diagnostics() const { return diagnostics_; }

 private:
  std::vector<Diagnostic> diagnostics_;
};
inline constexpr std::size_t kDiagnosticsMax = 20;

// Throws these problems of one file, in the order of their places.
[[noreturn]] void ThrowProblems(const std::filesystem::path& file, std::vector<YamlProblem> problems);

// The text of a YAML file, at most one byte more than kYamlBytesMax. Throws ScenarioError when it cannot be read.
std::string ReadYamlText(const std::filesystem::path& file);
// Its tree, which is a mapping and lacks what `problems` name. Throws ScenarioError when there is none.
YamlNode ParseMapping(const std::string& text, const std::filesystem::path& file,
                      std::vector<YamlProblem>& problems);

}  // namespace tiltproof::harness
