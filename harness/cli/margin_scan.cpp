#include "harness/cli/margin_scan.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

using ScanJson = nlohmann::ordered_json;

template <class Function>
void Read(const ScanJson& json, const char* key, const Function& take) {
  try {
    take(json.at(key));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{} of {}: {}", key, json.value("type", "a row"), error.what()));
  }
}

std::size_t CountSurvived(const Margin& margin) {
  const auto fails = [](const LevelAnswer& answer) { return answer.survived != true; };
  return static_cast<std::size_t>(std::find_if(margin.levels.begin(), margin.levels.end(), fails) -
                                  margin.levels.begin());
}

}  // namespace

void AddScan(const Margin& margin, int repeat_count, ScanJson& json) {
  json["levels"] = ScanJson::array();
  for (const LevelAnswer& answer : margin.levels)
    json["levels"].push_back({answer.level, answer.survived ? ScanJson(*answer.survived) : ScanJson()});
  json["pockets"] = ScanJson::array();
  for (const Pocket& pocket : margin.pockets) json["pockets"].push_back({pocket.from, pocket.to});
  json["survived_share"] = margin.survived_share ? ScanJson(*margin.survived_share) : ScanJson();
  json["seeds"] = margin.is_random ? repeat_count : 1;
  json["sure_share"] = margin.is_random ? SurePassShare(repeat_count) : 1.0;
}

void TakeScan(const ScanJson& json, Margin& margin) {
  Read(json, "levels", [&](const ScanJson& levels) {
    for (const ScanJson& level : levels)
      margin.levels.push_back(
          {level.at(0), level.at(1).is_null() ? std::nullopt : std::optional(level.at(1).get<bool>())});
  });
  Read(json, "pockets", [&](const ScanJson& pockets) {
    for (const ScanJson& pocket : pockets) margin.pockets.push_back({pocket.at(0), pocket.at(1)});
  });
  Read(json, "survived_share", [&](const ScanJson& share) {
    margin.survived_share = share.is_null() ? std::nullopt : std::optional(share.get<double>());
  });
  Read(json, "sure_share", [&](const ScanJson& share) { margin.is_random = share.get<double>() < 1; });
}

std::vector<std::string> ScanLines(const Margin& margin, int repeat_count, const std::string& unit) {
  const auto value = [&](double level) {
    return unit.empty() ? fmt::format("{}", level) : fmt::format("{} {}", level, unit);
  };
  std::vector<std::string> lines;
  for (const Pocket& pocket : margin.pockets) {
    const auto beyond = std::find_if(margin.levels.begin(), margin.levels.end(),
                                     [&](const auto& answer) { return answer.level == pocket.to; });
    const auto again =
        std::find_if(beyond, margin.levels.end(), [](const auto& answer) { return answer.survived == true; });
    const std::string where = pocket.from == pocket.to ? fmt::format("at {}", value(pocket.from))
                                                       : fmt::format("at every level flown from {} to {}",
                                                                     value(pocket.from), value(pocket.to));
    lines.push_back(fmt::format("fails {}, and survives {} again", where, value(again->level)));
  }
  if (const std::size_t count = CountSurvived(margin); count > 0)
    lines.push_back(fmt::format(
        "survives all {} levels that were flown below the limit, {}", count,
        margin.is_random
            ? fmt::format("{0} of {0} seeds each: 95 % sure that at least {1:.0f} % of all seeds pass",
                          repeat_count, 100 * SurePassShare(repeat_count))
            : "where nothing is drawn at random"));
  if (margin.survived_share)
    lines.push_back(fmt::format("survives {:.3g} % of the range", 100 * *margin.survived_share));
  lines.push_back(fmt::format("{} flight{} at {} level{}", margin.flights_count,
                              margin.flights_count == 1 ? "" : "s", margin.levels.size(),
                              margin.levels.size() == 1 ? "" : "s"));
  return lines;
}

}  // namespace tiltproof::harness
