// Values that keys of a scenario get in place of what its file says, each key by its path:
//
//   const std::vector<KeySetting> settings = {{"faults.loss.parameters.probability", "0.1"}, {"initial.position_m.2", "3"}};
//   const Scenario scenario = ReadScenarioWith("hover.yaml", settings, options);  // reader.h
//
// A path has the keys from the outside in, with dots between them. An item of a list of mappings has its `id` or `name`
// there, or its number; an item of another list has its number, from 0.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

struct KeySetting {
  std::string path;
  std::string value;  // YAML: "0.1", "[0, 0, 1]"
  friend bool operator==(const KeySetting&, const KeySetting&) = default;
};

// "1,[2, 3],'a,b'" is three values. Commas in brackets and quotes separate none.
std::vector<std::string> SplitValues(std::string_view text);

// Writes the values into a file's tree. `resolved` has every key of the scenario: lists of which one item is set come from
// there where the file has none. What the settings introduce has the mark of its setting; a key that no scenario has is for
// the reader to find.
void SetKeys(std::span<const KeySetting> settings, const YamlNode& resolved, YamlNode& root,
             std::vector<YamlProblem>& problems);

// The setting that a problem at this line is about; none: it is about the file.
std::optional<std::size_t> SettingOfLine(int line);

}  // namespace tiltproof::harness
