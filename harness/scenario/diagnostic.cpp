#include "harness/scenario/diagnostic.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

namespace tiltproof::harness {
namespace {

std::string JoinLines(const std::vector<Diagnostic>& diagnostics) {
  std::string text;
  for (const Diagnostic& diagnostic : diagnostics) {
    if (!text.empty()) text += '\n';
    text += ToString(diagnostic);
  }
  return text;
}

}  // namespace

std::string ToString(const Diagnostic& diagnostic) {
  if (diagnostic.line == 0) return fmt::format("{}: {}", diagnostic.file.string(), diagnostic.message);
  return fmt::format("{}:{}:{}: {}", diagnostic.file.string(), diagnostic.line, diagnostic.column,
                     diagnostic.message);
}

ScenarioError::ScenarioError(std::vector<Diagnostic> diagnostics)
    : std::runtime_error(JoinLines(diagnostics)), diagnostics_(std::move(diagnostics)) {}

std::string ReadYamlText(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) throw ScenarioError({{file, 0, 0, "no such file"}});
  std::ifstream in(file, std::ios::binary);
  // One byte more than allowed is enough to see that it is too large.
  std::string text(kYamlBytesMax + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!in.is_open() || in.bad()) throw ScenarioError({{file, 0, 0, "cannot be read"}});
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

void ThrowProblems(const std::filesystem::path& file, std::vector<YamlProblem> problems) {
  std::stable_sort(problems.begin(), problems.end(),
                   [](const auto& a, const auto& b) { return a.mark < b.mark; });
  std::vector<Diagnostic> diagnostics;
  for (YamlProblem& problem : problems) {
    if (diagnostics.size() == kDiagnosticsMax) {
      diagnostics.push_back(
          {file, 0, 0, fmt::format("and {} more problems", problems.size() - kDiagnosticsMax)});
      break;
    }
    diagnostics.push_back({file, problem.mark.line, problem.mark.column, std::move(problem.message)});
  }
  throw ScenarioError(std::move(diagnostics));
}

YamlNode ParseMapping(const std::string& text, const std::filesystem::path& file,
                      std::vector<YamlProblem>& problems) {
  // A model given as a scenario: what a YAML parser finds in it is of no use.
  std::string_view start = text;
  start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n"), start.size()));
  if (start.starts_with("<?xml") || start.starts_with("<sdf"))
    ThrowProblems(file, {{{}, "a model (XML), and a YAML file is needed; `tiltproof vehicle` reads models"}});
  std::optional<YamlNode> root = ParseYaml(text, problems);
  if (root && root->kind != YamlNode::Kind::kMapping)
    problems.push_back(
        {root->mark, fmt::format("expected a mapping of keys to values, found {}", Describe(*root))});
  if (!root || root->kind != YamlNode::Kind::kMapping) ThrowProblems(file, std::move(problems));
  return *std::move(root);
}

}  // namespace tiltproof::harness
