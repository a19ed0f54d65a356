#include "harness/cli/sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "harness/cli/commands.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kCellNameMax = 80;  // of a scenario, which may still get a seed

// As a part of a folder's name.
std::string InName(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool keeps = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       c == '_' || c == '.' || c == '-';
    if (keeps)
      name += c;
    else if (!name.empty() && name.back() != '_')
      name += '_';
  }
  return name;
}

SweepAxis ReadAxis(const std::string& flag) {
  const std::size_t equals = flag.find('=');
  if (equals == std::string::npos || equals == 0)
    throw UsageError(fmt::format(
        "--set {}: expected PATH=VALUE,..., for example faults.loss.parameters.probability=0.1,0.2", flag));
  SweepAxis axis{flag.substr(0, equals), SplitValues(flag.substr(equals + 1))};
  if (std::ranges::any_of(axis.values, [](const std::string& value) { return value.empty(); }))
    throw UsageError(fmt::format("--set {}: a value is empty", flag));
  if (axis.path == "name")
    throw UsageError(fmt::format("--set {}: each cell of the grid has a name of its own", flag));
  return axis;
}

}  // namespace

std::vector<SweepAxis> ReadSweep(const std::vector<std::string>& flags) {
  std::vector<SweepAxis> sweep;
  std::size_t cells = 1;
  for (const std::string& flag : flags) {
    SweepAxis axis = ReadAxis(flag);
    if (std::ranges::any_of(sweep, [&](const SweepAxis& other) { return other.path == axis.path; }))
      throw UsageError(fmt::format(
          "--set {}: this path is given twice; give all its values at once: {}=V1,V2", flag, axis.path));
    cells *= axis.values.size();
    if (cells > kCellsMax)
      throw UsageError(fmt::format("--set: the grid has more than {} cells; give fewer values", kCellsMax));
    sweep.push_back(std::move(axis));
  }
  return sweep;
}

std::vector<std::vector<KeySetting>> CellsOf(const std::vector<SweepAxis>& sweep) {
  std::vector<std::vector<KeySetting>> cells(1);
  for (const SweepAxis& axis : sweep) {
    std::vector<std::vector<KeySetting>> finer;
    for (const auto& cell : cells) {
      for (const std::string& value : axis.values) {
        finer.push_back(cell);
        finer.back().push_back({axis.path, value});
      }
    }
    cells = std::move(finer);
  }
  return cells;
}

std::vector<std::string> CellNames(const std::string& scenario,
                                   std::span<const std::vector<KeySetting>> cells) {
  std::vector<std::string> names;
  bool are_names = true;
  for (const auto& cell : cells) {
    std::string name = scenario;
    for (const KeySetting& setting : cell)
      name += fmt::format("-{}-{}", InName(setting.path.substr(setting.path.rfind('.') + 1)),
                          InName(setting.value));
    are_names = are_names && name.size() <= kCellNameMax;
    names.push_back(std::move(name));
  }
  if (are_names && std::set<std::string>(names.begin(), names.end()).size() == names.size()) return names;
  for (std::size_t i = 0; i < names.size(); ++i)
    names[i] = fmt::format("{}-set{}", scenario.substr(0, kCellNameMax), i + 1);
  return names;
}

std::string ToText(const KeySetting& setting) { return setting.path + "=" + setting.value; }

}  // namespace tiltproof::harness
