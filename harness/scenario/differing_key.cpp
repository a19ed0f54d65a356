#include "harness/scenario/differing_key.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include "harness/scenario/yaml_tree.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr std::array<std::string_view, 14> kMayDiffer = {"format",         "name",
                                                         "description",    "tags",
                                                         "expect",         "criteria",
                                                         "firmware",       "allow_restarts",
                                                         "control_period", "clean_line",
                                                         "delay_margin_s", "watch",
                                                         "gain",           "firmware_parameters"};

YamlNode Parse(std::string_view yaml) {
  std::vector<YamlProblem> problems;
  auto root = ParseYaml(yaml, problems);
  if (!problems.empty())
    throw std::runtime_error(
        fmt::format("{}:{}: {}", problems[0].mark.line, problems[0].mark.column, problems[0].message));
  if (!root || root->kind != YamlNode::Kind::kMapping)
    throw std::runtime_error("no mapping of keys to values");
  return *std::move(root);
}

std::string ValueText(const YamlNode* node) {
  if (node == nullptr) return "absent";
  switch (node->kind) {
    case YamlNode::Kind::kSequence: {
      std::vector<std::string> items;
      for (const YamlNode& item : node->items) items.push_back(ValueText(&item));
      return fmt::format("[{}]", fmt::join(items, ", "));
    }
    case YamlNode::Kind::kMapping:
      return fmt::format("{} keys", node->entries.size());
    case YamlNode::Kind::kNull:
    case YamlNode::Kind::kBool:
    case YamlNode::Kind::kNumber:
    case YamlNode::Kind::kText:
    case YamlNode::Kind::kAmbiguous:
      return node->text;
  }
  ThrowBrokenInvariant("a kind of YAML value");
}

bool IsListOfMappings(const YamlNode& node) {
  return node.kind == YamlNode::Kind::kSequence && !node.items.empty() &&
         node.items.front().kind == YamlNode::Kind::kMapping;
}

void AddDifferences(const std::string& path, const YamlNode* a, const YamlNode* b,
                    std::vector<std::string>& found);

// Keys of either, in the order of the first.
void AddDifferencesOfMappings(const std::string& path, const YamlNode& a, const YamlNode& b,
                              std::vector<std::string>& found) {
  std::vector<std::string_view> keys;
  for (const YamlNode* node : {&a, &b})
    for (const YamlEntry& entry : node->entries)
      if (std::find(keys.begin(), keys.end(), entry.key) == keys.end()) keys.push_back(entry.key);
  for (const std::string_view key : keys) {
    if (path.empty() && std::find(kMayDiffer.begin(), kMayDiffer.end(), key) != kMayDiffer.end()) continue;
    const YamlEntry* in_a = a.Find(key);
    const YamlEntry* in_b = b.Find(key);
    AddDifferences(path.empty() ? std::string(key) : fmt::format("{}.{}", path, key),
                   in_a == nullptr ? nullptr : &in_a->value, in_b == nullptr ? nullptr : &in_b->value, found);
  }
}

void AddDifferences(const std::string& path, const YamlNode* a, const YamlNode* b,
                    std::vector<std::string>& found) {
  if (a != nullptr && b != nullptr && a->kind == b->kind) {
    if (a->kind == YamlNode::Kind::kMapping) return AddDifferencesOfMappings(path, *a, *b, found);
    if (IsListOfMappings(*a) && IsListOfMappings(*b)) {
      for (std::size_t i = 0; i < std::min(a->items.size(), b->items.size()); ++i)
        AddDifferences(fmt::format("{}[{}]", path, i), &a->items[i], &b->items[i], found);
      if (a->items.size() != b->items.size())
        found.push_back(fmt::format("{}: {} and {} items", path, a->items.size(), b->items.size()));
      return;
    }
    if (ValueText(a) == ValueText(b)) return;
  }
  found.push_back(fmt::format("{}: {} and {}", path, ValueText(a), ValueText(b)));
}

}  // namespace

std::vector<std::string> DifferingKeys(std::string_view yaml_a, std::string_view yaml_b) {
  std::vector<std::string> found;
  AddDifferencesOfMappings("", Parse(yaml_a), Parse(yaml_b), found);
  return found;
}

}  // namespace tiltproof::harness
