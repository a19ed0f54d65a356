#include "harness/campaign/campaign_file.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "faults/registry.h"
#include "harness/scenario/diagnostic.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/mapping_reader.h"

namespace tiltproof::harness {
namespace {

using faults::FaultType;
using faults::ParameterInfo;
using faults::ParameterKind;

constexpr double kLongest_s = 86400;
constexpr std::array<std::pair<std::string_view, Distribution::Kind>, 3> kKinds = {
    {{"uniform", Distribution::Kind::kUniform},
     {"log_uniform", Distribution::Kind::kLogUniform},
     {"choice", Distribution::Kind::kChoice}}};

std::string_view Name(Distribution::Kind kind) {
  for (const auto& [name, known] : kKinds)
    if (known == kind) return name;
  return {};
}

bool CanBeDrawn(ParameterKind kind) {
  return kind != ParameterKind::kVector && kind != ParameterKind::kFrameWords;
}

void DescribeDistribution(KeyVisitor& v, Distribution& distribution) {
  const std::array<KeyGroup, 3> groups = {KeyGroup{"uniform"}, KeyGroup{"log_uniform"}, KeyGroup{"choice"}};
  v.ExactlyOne("a distribution", groups);
  constexpr std::array kDocs = {"[least, greatest]: every number between them is equally likely",
                                "[least, greatest]: the same for the number's logarithm",
                                "Numbers or words of which each is equally likely"};
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    std::vector<NumberOrWord> values;
    if (kKinds[i].second == distribution.kind) values = distribution.values;
    const bool was_there = !values.empty();
    v.Values({kKinds[i].first, kDocs[i]}, values);
    if (values.empty() || was_there) continue;
    distribution = {kKinds[i].second, std::move(values)};
  }
}

void DescribeMaybe(KeyVisitor& v, const Key& key, std::optional<Distribution>& distribution) {
  v.MaybeSection(key, distribution.has_value(), [&](KeyVisitor& w) {
    if (!distribution) distribution.emplace();
    DescribeDistribution(w, *distribution);
  });
}

void DescribeParameters(KeyVisitor& v, std::map<std::string, std::map<std::string, Distribution>>& drawn) {
  for (const FaultType& type : faults::FaultTypes()) {
    const std::string name(type.name);
    v.MaybeSection({type.name, type.summary}, drawn.contains(name), [&](KeyVisitor& w) {
      for (const ParameterInfo& info : type.parameters) {
        if (!CanBeDrawn(info.kind)) continue;
        std::map<std::string, Distribution>& own = drawn[name];
        const std::string parameter(info.name);
        w.MaybeSection({info.name, info.doc}, own.contains(parameter),
                       [&](KeyVisitor& x) { DescribeDistribution(x, own[parameter]); });
      }
    });
  }
}

constexpr TextRule kPattern = {"([a-z0-9_.*?-]|\\[|\\])+", "a fault type, or a pattern of several: sensor.*",
                               100};
constexpr TextRule kBuildRule = {"[a-z0-9_]+", "lower-case letters, digits and '_'", 100};

void DescribeDraw(KeyVisitor& v, DrawSpec& draw) {
  v.Texts({"types", "Patterns of fault types; absent or empty: every type that the client can take"},
          draw.types, kPattern);
  v.Bool({"swarm", "Each flight draws from a random subset of the types"}, draw.swarm);
  v.Section({"faults_count", "Faults in one flight"}, [&](KeyVisitor& w) {
    w.Integer({"min", "Least number"}, draw.faults_count_min, {0, 100});
    w.Integer({"max", "Greatest number"}, draw.faults_count_max, {1, 100});
  });
  v.Section({"parameters", "Distributions of parameters, by fault type"},
            [&](KeyVisitor& w) { DescribeParameters(w, draw.parameters); });
  DescribeMaybe(v, {"start_s", "When a fault begins; absent: uniformly in the flight"}, draw.start_s);
  DescribeMaybe(v,
                {"length_s", "How long a fault lasts; absent: from one control period to the flight's end"},
                draw.length_s);
  v.MaybeNumber(
      {"recover_s",
       "Every fault ends so long before the flight does, and the criteria must hold again at the end"},
      draw.recover_s, {0, kLongest_s});
}

void DescribeCampaign(KeyVisitor& v, CampaignSpec& spec) {
  v.Text({"campaign", "Name of the campaign", Presence::kRequired}, spec.name, kNameRule);
  v.Texts({"scenarios", "Scenario files that are flown in turn", Presence::kRequired}, spec.scenarios, {});
  v.Integer({"runs_count", "Number of flights"}, spec.runs_count, {1, static_cast<double>(kRunsMax)});
  v.Integer({"seed", "Seed of all draws"}, spec.seed, {0, 9007199254740991.0});
  v.Texts({"firmware", "Builds of the firmware that fly the same draws; absent: as each scenario says"},
          spec.firmware, kBuildRule);
  v.Section({"draw", "What is drawn for each flight"}, [&](KeyVisitor& w) { DescribeDraw(w, spec.draw); });
  v.Section({"stop", "Ends the campaign early"}, [&](KeyVisitor& w) {
    w.Integer({"failures_count", "After so many failures; 0: never"}, spec.stop.failures_count,
              {0, static_cast<double>(kRunsMax)});
    w.MaybeNumber({"wall_s", "After so many seconds"}, spec.stop.wall_s, {1, 1e7});
  });
}

// Checks how the keys fit each other and the registry of faults.
class Checker {
 public:
  Checker(const YamlNode& root, std::span<const std::string_view> builds, CampaignSpec& spec,
          std::vector<YamlProblem>& problems)
      : root_(root), builds_(builds), spec_(spec), problems_(problems) {}

  void Run() {
    const YamlNode* draw = ValueOf(&root_, "draw");
    CheckLists();
    CheckBuilds(ValueOf(&root_, "firmware"));
    CheckTypes(ValueOf(draw, "types"));
    if (spec_.draw.faults_count_min > spec_.draw.faults_count_max)
      Complain(
          PlaceOf(root_, "draw.faults_count.min"),
          fmt::format("min: {} is above max, {}", spec_.draw.faults_count_min, spec_.draw.faults_count_max));
    if (spec_.draw.start_s) CheckTime("start_s", ValueOf(draw, "start_s"), *spec_.draw.start_s);
    if (spec_.draw.length_s) CheckTime("length_s", ValueOf(draw, "length_s"), *spec_.draw.length_s);
    CheckParameters(ValueOf(draw, "parameters"));
  }

 private:
  void Complain(YamlMark mark, std::string message) { problems_.push_back({mark, std::move(message)}); }

  void CheckLists() {
    const YamlNode* scenarios = ValueOf(&root_, "scenarios");
    if (scenarios != nullptr && scenarios->kind == YamlNode::Kind::kSequence && scenarios->items.empty())
      Complain(scenarios->mark, "scenarios: the list is empty");
  }

  void CheckBuilds(const YamlNode* list) {
    if (list == nullptr || list->items.size() != spec_.firmware.size()) return;  // and said so
    for (auto build = spec_.firmware.begin(); build != spec_.firmware.end(); ++build) {
      const YamlMark mark = list->items[static_cast<std::size_t>(build - spec_.firmware.begin())].mark;
      if (std::find(spec_.firmware.begin(), build, *build) != build)
        Complain(mark, fmt::format("firmware: {} is named twice", *build));
      else if (!builds_.empty() && std::ranges::find(builds_, *build) == builds_.end())
        Complain(mark, fmt::format("firmware: {}", UnknownBuild(*build, builds_)));
    }
  }

  void CheckTypes(const YamlNode* list) {
    if (list == nullptr || list->items.size() != spec_.draw.types.size()) return;  // and said so
    for (std::size_t i = 0; i < list->items.size(); ++i) {
      const std::string& pattern = spec_.draw.types[i];
      const std::vector<FaultType>& types = faults::FaultTypes();
      if (std::ranges::any_of(types, [&](const FaultType& type) { return MatchesType(pattern, type.name); }))
        continue;
      std::set<std::string> names;
      for (const FaultType& type : types)
        names.insert({std::string(type.name), fmt::format("{}.*", type.layer())});
      const std::vector<std::string_view> known(names.begin(), names.end());
      Complain(list->items[i].mark,
               fmt::format("types: '{}' matches no fault type{}", pattern, DidYouMean(pattern, known)));
    }
  }

  // True if the values are as many, and in the order, that the kind needs.
  bool CheckShape(std::string_view key, YamlMark mark, const Distribution& distribution) {
    if (distribution.kind == Distribution::Kind::kChoice) return true;
    const std::string_view kind = Name(distribution.kind);
    const auto number = [&](std::size_t i) { return std::get_if<double>(&distribution.values[i]); };
    if (distribution.values.size() != 2 || number(0) == nullptr || number(1) == nullptr) {
      Complain(mark, fmt::format("{}: {} needs two numbers: [least, greatest]", key, kind));
      return false;
    }
    const double least = *number(0), greatest = *number(1);
    if (least > greatest) {
      Complain(mark, fmt::format("{}: {} is above {}: write the lesser one first", key, least, greatest));
      return false;
    }
    if (distribution.kind == Distribution::Kind::kLogUniform && least * greatest <= 0) {
      Complain(mark,
               fmt::format("{}: log_uniform needs two numbers above 0, or two below it; found {} and {}", key,
                           least, greatest));
      return false;
    }
    return true;
  }

  void CheckTime(std::string_view key, const YamlNode* node, const Distribution& distribution) {
    if (node == nullptr || distribution.values.empty()) return;
    if (!CheckShape(key, node->mark, distribution)) return;
    for (const NumberOrWord& value : distribution.values) {
      const auto* seconds = std::get_if<double>(&value);
      if (seconds == nullptr || *seconds < 0 || *seconds > kLongest_s)
        return Complain(node->mark, fmt::format("{}: expected seconds from 0 to {}, found {}", key,
                                                kLongest_s, Text(value)));
    }
  }

  void CheckParameters(const YamlNode* node) {
    if (node == nullptr) return;
    for (const YamlEntry& entry : node->entries) {
      const FaultType* type = faults::FindFaultType(entry.key);
      const auto drawn = spec_.draw.parameters.find(entry.key);
      if (type == nullptr || drawn == spec_.draw.parameters.end()) continue;  // unknown, and said so
      const auto& types = spec_.draw.types;
      if (!types.empty() && std::none_of(types.begin(), types.end(), [&](const std::string& pattern) {
            return MatchesType(pattern, type->name);
          }))
        Complain(entry.key_mark, fmt::format("parameters: {} is not among `types`", entry.key));
      for (const YamlEntry& parameter : entry.value.entries) {
        const auto distribution = drawn->second.find(parameter.key);
        if (distribution == drawn->second.end() || distribution->second.values.empty()) continue;
        for (const ParameterInfo& info : type->parameters)
          if (info.name == parameter.key) CheckParameter(info, parameter.value.mark, distribution->second);
      }
    }
  }

  void CheckParameter(const ParameterInfo& info, YamlMark mark, const Distribution& distribution) {
    const bool is_number = info.kind == ParameterKind::kNumber || info.kind == ParameterKind::kInteger;
    if (!is_number && distribution.kind != Distribution::Kind::kChoice)
      return Complain(mark, fmt::format("{}: is a word: draw it by `choice`", info.name));
    if (!CheckShape(info.name, mark, distribution)) return;
    for (const NumberOrWord& value : distribution.values) {
      const auto* number = std::get_if<double>(&value);
      if (is_number != (number != nullptr))
        return Complain(mark, fmt::format("{}: expected {}, found {}", info.name,
                                          is_number ? "numbers" : "words", Text(value)));
      if (is_number && (*number < info.min || *number > info.max))
        return Complain(mark, fmt::format("{}: {} is out of range; must be from {} to {}", info.name, *number,
                                          info.min, info.max));
      if (info.kind == ParameterKind::kChoice) {
        const auto& word = std::get<std::string>(value);
        if (std::find(info.choices.begin(), info.choices.end(), word) == info.choices.end())
          return Complain(
              mark, fmt::format("{}: unknown value '{}'{}", info.name, word, DidYouMean(word, info.choices)));
      }
    }
  }

  static std::string Text(const NumberOrWord& value) {
    const auto* word = std::get_if<std::string>(&value);
    return word != nullptr ? fmt::format("'{}'", *word) : fmt::format("{}", std::get<double>(value));
  }

  const YamlNode& root_;
  std::span<const std::string_view> builds_;
  CampaignSpec& spec_;
  std::vector<YamlProblem>& problems_;
};

// `campaign` may be forgotten.
bool HasKeyOfCampaign(const YamlNode& root) {
  return root.Find("campaign") != nullptr || root.Find("scenarios") != nullptr ||
         root.Find("draw") != nullptr;
}

}  // namespace

bool MatchesType(const std::string& pattern, std::string_view type) {
  return fnmatch(pattern.c_str(), std::string(type).c_str(), 0) == 0;
}

bool IsCampaignFile(const std::filesystem::path& file) {
  try {
    std::vector<YamlProblem> problems;
    return std::filesystem::is_regular_file(file) &&
           HasKeyOfCampaign(ParseMapping(ReadYamlText(file), file, problems));
  } catch (const ScenarioError&) {
    return false;
  }
}

CampaignSpec ParseCampaign(const std::string& text, const std::filesystem::path& file,
                           std::span<const std::string_view> builds) {
  std::vector<YamlProblem> problems;
  const YamlNode root = ParseMapping(text, file, problems);
  CampaignSpec spec;
  MappingReader reader(root, problems);
  DescribeCampaign(reader, spec);
  reader.Finish();
  Checker(root, builds, spec, problems).Run();
  if (!problems.empty()) ThrowProblems(file, std::move(problems));
  for (auto& [type, drawn] : spec.draw.parameters)
    std::erase_if(drawn, [](const auto& one) { return one.second.values.empty(); });
  std::erase_if(spec.draw.parameters, [](const auto& one) { return one.second.empty(); });
  for (std::string& scenario : spec.scenarios)
    scenario = std::filesystem::absolute(file.parent_path() / scenario).lexically_normal().string();
  return spec;
}

CampaignSpec ReadCampaignFile(const std::filesystem::path& file, std::span<const std::string_view> builds) {
  return ParseCampaign(ReadYamlText(file), file, builds);
}

std::string WriteCampaign(const CampaignSpec& spec) {
  return WriteKeys([&](KeyVisitor& writer) {
    CampaignSpec written = spec;
    DescribeCampaign(writer, written);
  });
}

}  // namespace tiltproof::harness
