// Shared parts of a scenario's checks: problems with their places, names, files.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/scenario/protocol_file.h"
#include "harness/scenario/scenario.h"
#include "harness/scenario/yaml_tree.h"
#include "link/protocol.h"

namespace tiltproof::harness {

class ScenarioCheck {
 protected:
  ScenarioCheck(Scenario& scenario, std::vector<YamlProblem>& problems)
      : scenario_(scenario), problems_(problems) {}

  static std::string DidYouMeanOf(std::string_view name, const std::vector<std::string>& valid);

  void Complain(YamlMark mark, std::string message) { problems_.push_back({mark, std::move(message)}); }
  void Complain(const YamlNode& mapping, std::string_view path, std::string message) {
    Complain(PlaceOf(mapping, path), std::move(message));
  }

  // True if the reader has reported that it cannot use this value.
  bool Troubled(const YamlNode& node) const { return Troubled(node.mark); }
  bool Troubled(const YamlMark& mark) const;
  // A value that is there and good.
  const YamlNode* Good(const YamlNode& mapping, std::string_view key) const;

  std::filesystem::path RelativeToScenario(const std::filesystem::path& file) const;

  // Complains unless the id names one of the clients.
  void CheckClient(std::string_view key, YamlMark mark, const std::string& id);

  // The protocol that is no shipped one: a file, or a mapping as resolved scenarios have it. Null: it is shipped, or wrong.
  std::shared_ptr<const link::Protocol> UsersProtocol(const YamlNode& node, const YamlNode*& root,
                                                      ProtocolFile& loaded, std::filesystem::path& file);

  Scenario& scenario_;
  std::vector<YamlProblem>& problems_;
};

}  // namespace tiltproof::harness
