#include "harness/cli/lqr_weights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "harness/cli/commands.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {
namespace {

constexpr double kWeightMax = 1e12;

// The lines `name,value` as the mapping that the same text in YAML is.
YamlNode ParseCsv(const std::string& text, std::vector<YamlProblem>& problems) {
  YamlNode root;
  root.kind = YamlNode::Kind::kMapping;
  int line = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string row = text.substr(at, end - at);
    at = end + 1;
    ++line;
    if (!row.empty() && row.back() == '\r') row.pop_back();
    if (row.empty()) continue;
    const std::size_t comma = row.find(',');
    if (comma == std::string::npos || row.find(',', comma + 1) != std::string::npos) {
      problems.push_back({{line, 1}, "expected a name, a comma and a number, such as x_m,5"});
      continue;
    }
    YamlNode value;
    value.kind = YamlNode::Kind::kNumber;
    value.mark = {line, static_cast<int>(comma) + 2};
    value.text = row.substr(comma + 1);
    const std::string name = row.substr(0, comma);
    if (root.Find(name) != nullptr)
      problems.push_back({{line, 1}, fmt::format("the name '{}' is there already", name)});
    else
      root.entries.push_back({name, {line, 1}, std::move(value)});
  }
  return root;
}

void SetWeights(const YamlNode& root, const std::vector<std::string>& names, plant::LqrWeights& weights,
                std::vector<YamlProblem>& problems) {
  const std::vector<std::string_view> views(names.begin(), names.end());
  for (const YamlEntry& entry : root.entries) {
    const auto found = std::find(names.begin(), names.end(), entry.key);
    if (found == names.end()) {
      problems.push_back(
          {entry.key_mark, fmt::format("unknown name '{}'{}; the names of this vehicle are {}", entry.key,
                                       DidYouMean(entry.key, views), fmt::join(names, ", "))});
      continue;
    }
    const double value =
        entry.value.kind == YamlNode::Kind::kNumber ? entry.value.Number().value_or(0.0) : 0.0;
    if (!(value > 0 && value <= kWeightMax)) {
      problems.push_back(
          {entry.value.mark, fmt::format("{}: expected a number above 0 and up to {:g}, found {}", entry.key,
                                         kWeightMax, Describe(entry.value))});
      continue;
    }
    const auto place = static_cast<Eigen::Index>(found - names.begin());
    (place < weights.q.size() ? weights.q[place] : weights.r[place - weights.q.size()]) = value;
  }
}

}  // namespace

plant::LqrWeights ReadLqrWeights(const std::filesystem::path& file, const plant::VehicleModel& model,
                                 plant::LqrWeights defaults) {
  std::ifstream in(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(in), {});
  if (!in) throw UsageError(fmt::format("--weights {}: cannot be read", file.string()));
  text.resize(std::min(text.size(), kYamlBytesMax + 1));
  std::vector<YamlProblem> problems;
  std::optional<YamlNode> root;
  if (file.extension() == ".csv")
    root = ParseCsv(text, problems);
  else
    root = ParseYaml(text, problems);
  if (root && root->kind != YamlNode::Kind::kMapping)
    problems.push_back(
        {root->mark,
         fmt::format("expected names and their weights, such as `x_m: 5`, found {}", Describe(*root))});
  else if (root)
    SetWeights(*root, plant::WeightNames(model), defaults, problems);
  if (problems.empty()) return defaults;
  std::vector<std::string> lines;
  for (const YamlProblem& problem : problems)
    lines.push_back(
        fmt::format("{}:{}:{}: {}", file.string(), problem.mark.line, problem.mark.column, problem.message));
  throw UsageError(fmt::format("{}", fmt::join(lines, "\n")));
}

}  // namespace tiltproof::harness
