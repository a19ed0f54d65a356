#include "harness/scenario/reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <utility>

#include "harness/scenario/compound.h"
#include "harness/scenario/fault_keys.h"
#include "harness/scenario/keys.h"
#include "harness/scenario/mapping_reader.h"
#include "harness/scenario/scenario_checks.h"
#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {
namespace {

// The longest duration of a fault that is added.
constexpr double kInjectedMax_s = 14'400;

Scenario Interpret(
    const std::filesystem::path& file, YamlNode& root, const ReadOptions& options,
    std::vector<YamlProblem>& problems,
    const std::function<void(YamlNode& root)>& change = [](const auto&) {}) {
  ResolveCompounds(root, problems);
  change(root);
  Scenario scenario;
  scenario.file = file;
  MappingReader reader(root, problems);
  DescribeScenario(reader, scenario);
  reader.Finish();
  CheckScenario(root, options, scenario, problems);
  if (!problems.empty()) ThrowProblems(file, std::move(problems));
  return scenario;
}

// The scenario, and where its name stands.
std::pair<Scenario, YamlMark> Read(const std::filesystem::path& file, const std::string& text,
                                   const ReadOptions& options) {
  std::vector<YamlProblem> problems;
  YamlNode root = ParseMapping(text, file, problems);
  if (const YamlEntry* protocol = root.Find("protocol");
      protocol != nullptr && root.Find("messages") != nullptr)
    ThrowProblems(file,
                  {{protocol->key_mark,
                    fmt::format("this is a protocol file, not a scenario: a scenario names it with `link: "
                                "{{protocol: {}}}`",
                                file.filename().string())}});
  if (const YamlEntry* campaign = root.Find("campaign");
      campaign != nullptr && root.Find("scenarios") != nullptr)
    ThrowProblems(file, {{campaign->key_mark,
                          "this is a campaign file, not a scenario: fly it with `tiltproof campaign`"}});
  Scenario scenario = Interpret(file, root, options, problems);
  return {std::move(scenario), root.Find("name")->value.mark};
}

// Keys that say when a fault acts, or are for files.
constexpr std::array kNotWhileFlying = {"start_s", "end_s", "when", "edge", "after", "compound"};

YamlEntry Scalar(const char* key, YamlNode::Kind kind, YamlMark mark, std::string text) {
  YamlNode value;
  value.kind = kind;
  value.mark = mark;
  value.text = std::move(text);
  return {key, mark, std::move(value)};
}

// Takes what is only for a fault that is added out of it, and puts its window in.
void SetWindow(const AddedFault& fault, YamlNode& node, std::vector<YamlProblem>& problems) {
  for (const YamlEntry& entry : node.entries)
    if (std::find(kNotWhileFlying.begin(), kNotWhileFlying.end(), entry.key) != kNotWhileFlying.end())
      problems.push_back(
          {entry.key_mark, fmt::format("{}: a fault that is injected begins now; duration_s says for "
                                       "how long (without it: to the end)",
                                       entry.key)});
  const double start_s = ToSeconds(fault.start_ns);
  double end_s = 0;
  if (const YamlEntry* duration = node.Find("duration_s")) {
    const double duration_s = duration->value.Number().value_or(0.0);
    if (duration->value.kind != YamlNode::Kind::kNumber || !(duration_s > 0) || duration_s > kInjectedMax_s)
      problems.push_back(
          {duration->value.mark,
           fmt::format("duration_s: expected a number of seconds above 0 and up to {}, found {}",
                       kInjectedMax_s, Describe(duration->value))});
    else
      end_s = start_s + duration_s;
  }
  std::erase_if(node.entries, [](const YamlEntry& entry) { return entry.key == "duration_s"; });
  if (node.Find("id") == nullptr)
    node.entries.push_back(Scalar("id", YamlNode::Kind::kText, node.mark, fault.id));
  node.entries.push_back(
      Scalar("start_s", YamlNode::Kind::kNumber, node.mark, fmt::format("{:.9f}", start_s)));
  if (end_s > 0)
    node.entries.push_back(Scalar("end_s", YamlNode::Kind::kNumber, node.mark, fmt::format("{:.9f}", end_s)));
}

// Its window was given as duration_s: that is what a complaint about its end is about.
[[noreturn]] void ThrowInWordsOf(const ScenarioError& error, const YamlMark& duration) {
  std::vector<Diagnostic> diagnostics = error.diagnostics();
  for (Diagnostic& diagnostic : diagnostics) {
    constexpr std::string_view kEnd = "end_s";
    if (!diagnostic.message.starts_with(kEnd)) continue;
    for (std::size_t at = 0; (at = diagnostic.message.find(kEnd, at)) != std::string::npos;)
      diagnostic.message.replace(at, kEnd.size(), "duration_s");
    diagnostic.line = duration.line;
    diagnostic.column = duration.column;
  }
  throw ScenarioError(std::move(diagnostics));
}

}  // namespace

Scenario ReadScenario(const std::filesystem::path& file, const ReadOptions& options) {
  return Read(file, ReadYamlText(file), options).first;
}

Scenario ReadScenarioWith(const std::filesystem::path& file, std::span<const KeySetting> settings,
                          const ReadOptions& options) {
  const std::string text = ReadYamlText(file);
  std::vector<YamlProblem> problems;
  // The file alone is valid: what is wrong afterwards is a setting's fault.
  const std::string resolved_text = WriteResolved(Read(file, text, options).first);
  const YamlNode resolved = ParseMapping(resolved_text, file, problems);
  YamlNode root = ParseMapping(text, file, problems);
  return Interpret(file, root, options, problems,
                   [&](YamlNode& tree) { SetKeys(settings, resolved, tree, problems); });
}

Scenario WithSettings(const Scenario& scenario, std::span<const KeySetting> settings,
                      const ReadOptions& options) {
  std::vector<YamlProblem> problems;
  const YamlNode resolved = ParseMapping(WriteResolved(scenario), scenario.file, problems);
  YamlNode root = resolved;
  return Interpret(scenario.file, root, options, problems,
                   [&](YamlNode& tree) { SetKeys(settings, resolved, tree, problems); });
}

Scenario ParseScenario(const std::string& text, const std::filesystem::path& file,
                       const ReadOptions& options) {
  return Read(file, text, options).first;
}

void AddFault(Scenario& scenario, const AddedFault& fault, const ReadOptions& options) {
  const std::filesystem::path file = "fault";
  std::vector<YamlProblem> problems;
  std::optional<YamlNode> node = ParseYaml(fault.text, problems);
  if (node && node->kind != YamlNode::Kind::kMapping)
    problems.push_back(
        {node->mark, fmt::format("expected a fault, for example {{type: frame.drop, target: to_client, "
                                 "duration_s: 2, parameters: {{probability: 0.5}}}}, found {}",
                                 Describe(*node))});
  if (!node || !problems.empty()) ThrowProblems(file, std::move(problems));
  const YamlEntry* given = node->Find("duration_s");
  const YamlMark duration = given == nullptr ? node->mark : given->key_mark;
  SetWindow(fault, *node, problems);
  if (!problems.empty()) ThrowProblems(file, std::move(problems));
  const std::filesystem::path own_file = std::exchange(scenario.file, file);  // of places
  MappingReader reader(*node, problems);
  DescribeFault(reader, scenario.faults.emplace_back());
  reader.Finish();
  CheckLastFault(*node, options, scenario, problems);
  scenario.file = own_file;
  if (problems.empty()) return;
  scenario.faults.pop_back();
  scenario.fault_places.pop_back();
  try {
    ThrowProblems(file, std::move(problems));
  } catch (const ScenarioError& error) {
    ThrowInWordsOf(error, duration);
  }
}

std::vector<Scenario> ReadScenarios(const std::vector<std::filesystem::path>& files,
                                    const ReadOptions& options) {
  std::vector<Scenario> scenarios;
  std::vector<Diagnostic> diagnostics;
  std::map<std::string, std::string> places;  // of each name, "file:line:column"
  for (const auto& file : files) {
    try {
      auto [scenario, mark] = Read(file, ReadYamlText(file), options);
      const auto [first, is_new] =
          places.try_emplace(scenario.name, fmt::format("{}:{}:{}", file.string(), mark.line, mark.column));
      if (!is_new) {
        diagnostics.push_back(
            {file, mark.line, mark.column,
             fmt::format("the name '{}' is taken already at {}", scenario.name, first->second)});
      }
      scenarios.push_back(std::move(scenario));
    } catch (const ScenarioError& error) {
      diagnostics.insert(diagnostics.end(), error.diagnostics().begin(), error.diagnostics().end());
    }
  }
  if (!diagnostics.empty()) throw ScenarioError(std::move(diagnostics));
  return scenarios;
}

}  // namespace tiltproof::harness
