#include "harness/scenario/scenario_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "harness/scenario/diagnostic.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/mapping_reader.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::harness {

std::string ScenarioCheck::DidYouMeanOf(std::string_view name, const std::vector<std::string>& valid) {
  const std::vector<std::string_view> views(valid.begin(), valid.end());
  return DidYouMean(name, views);
}

bool ScenarioCheck::Troubled(const YamlMark& mark) const {
  return std::any_of(problems_.begin(), problems_.end(),
                     [&](const YamlProblem& p) { return p.mark == mark; });
}

const YamlNode* ScenarioCheck::Good(const YamlNode& mapping, std::string_view key) const {
  const YamlNode* node = ValueOf(&mapping, key);
  return node == nullptr || Troubled(*node) ? nullptr : node;
}

std::filesystem::path ScenarioCheck::RelativeToScenario(const std::filesystem::path& file) const {
  return std::filesystem::absolute(scenario_.file.parent_path() / file).lexically_normal();
}

void ScenarioCheck::CheckClient(std::string_view key, YamlMark mark, const std::string& id) {
  if (scenario_.FindClient(id)) return;
  std::vector<std::string> ids;
  for (std::size_t i = 0; i < scenario_.client_count(); ++i) ids.push_back(scenario_.client_id(i));
  Complain(mark, fmt::format("{}: there is no client '{}'{}", key, id, DidYouMeanOf(id, ids)));
}

std::shared_ptr<const link::Protocol> ScenarioCheck::UsersProtocol(const YamlNode& node,
                                                                   const YamlNode*& root,
                                                                   ProtocolFile& loaded,
                                                                   std::filesystem::path& file) {
  if (node.kind == YamlNode::Kind::kMapping) {
    root = &node;
    ProtocolSpec spec;
    std::vector<YamlProblem> said;  // by the reader of the scenario
    MappingReader reader(node, said);
    DescribeProtocol(reader, spec);
    reader.Finish();
    if (!said.empty()) return nullptr;
    if (std::string taken = TakenProtocolName(spec.name); !taken.empty()) {
      Complain(PlaceOf(node, "protocol"), std::move(taken));
      return nullptr;
    }
    return MakeProtocol(spec, node, problems_);
  }
  if (FindProtocol(node.text) != nullptr) return nullptr;
  try {
    file = RelativeToScenario(node.text);
    loaded = LoadProtocolFile(file);
    root = &loaded.root;
    return loaded.protocol;
  } catch (const ScenarioError& error) {
    for (const Diagnostic& diagnostic : error.diagnostics())
      Complain(node.mark, fmt::format("protocol: {}", ToString(diagnostic)));
  }
  return nullptr;
}

}  // namespace tiltproof::harness
