#include "harness/cli/envelope_resume.h"

#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "harness/cli/commands.h"
#include "harness/cli/margin_scan.h"
#include "harness/report/files.h"

namespace tiltproof::harness {
namespace {

using EarlierJson = nlohmann::ordered_json;

std::optional<double> NumberOf(const EarlierJson& row, const char* key) {
  const EarlierJson& value = row.at(key);
  if (!value.is_number() && !value.is_null())
    throw std::runtime_error(
        fmt::format("{} of {}: {} is no number", key, row.value("type", "a row"), value.dump()));
  return value.is_null() ? std::nullopt : std::optional(value.get<double>());
}

Margin MarginOf(const EarlierJson& row) {
  Margin margin;
  margin.survives = NumberOf(row, "survives");
  margin.fails = NumberOf(row, "fails");
  margin.flights_count = row.at("runs");
  TakeScan(row, margin);
  if (!margin.fails) return margin;
  margin.at_fails.answer = TrialResult::Answer::kFailed;
  margin.at_fails.criterion = row.at("first_criterion");
  margin.at_fails.seed = row.at("seed");
  margin.at_fails.time_s = NumberOf(row, "time_s");
  margin.at_fails.reason = row.at("reason");
  return margin;
}

// The first difference, with both values; empty when there is none.
std::string Difference(const EarlierJson& then, const Envelope& now) {
  const auto differs = [](const std::string& what, const EarlierJson& a, const EarlierJson& b) {
    return a == b ? "" : fmt::format("{} was {} and is {}", what, a.dump(), b.dump());
  };
  std::string found = differs("the version", then.at("version"), Version());
  if (found.empty()) found = differs("the scenario", then.at("scenario"), now.scenario);
  if (found.empty()) found = differs("the seed", then.at("seed"), now.seed);
  if (found.empty()) found = differs("--repeats", then.at("repeats"), now.repeat_count);
  if (found.empty()) found = differs("--tolerance", then.at("tolerance"), now.tolerance);
  for (const EnvelopeColumn& column : now.columns) {
    if (!found.empty() || !then.at("columns").contains(column.client)) continue;
    const EarlierJson& own = then["columns"][column.client];
    if (own.at("scenario") != column.scenario)
      found = fmt::format("the scenario, or the vehicle, of {} was another one", column.client);
    else if (own.at("build") != column.build)
      found = fmt::format("{} was flown with another build of the program or the firmware", column.client);
  }
  return found;
}

using RowKey = std::tuple<std::string, std::string, std::string, std::string>;

RowKey KeyOf(const EarlierJson& row) {
  std::string place;
  for (const char* key : {"target", "signal", "actuator"}) place += row.value(key, "");
  return {row.at("type"), place, row.value("side", ""), row.at("client")};
}

// The file's content outside this selection of types and clients.
EnvelopeEarlier NotSelected(const EarlierJson& then, const Envelope& now) {
  EnvelopeEarlier earlier;
  std::set<std::string> clients;
  std::set<RowKey> selected;
  std::set<std::pair<std::string, std::string>> types;
  for (const EnvelopeColumn& column : now.columns) clients.insert(column.client);
  for (const EnvelopeEntry& entry : now.entries) {
    const std::string type(entry.row.type->name);
    selected.insert({type, entry.row.place, entry.row.side, entry.client});
    types.insert({type, entry.client});
  }
  for (const EnvelopeNotApplicable& other : now.not_applicable) types.insert({other.type, other.client});
  for (const auto& [client, column] : then.at("columns").items())
    if (!clients.contains(client))
      earlier.columns.push_back({client, column.at("scenario"), column.at("flags"), column.at("build")});
  for (const EarlierJson& row : then.at("rows"))
    if (!selected.contains(KeyOf(row))) earlier.rows.push_back(row.dump());
  for (const EarlierJson& row : then.at("not_applicable"))
    if (!types.contains({row.at("type"), row.at("client")})) earlier.not_applicable.push_back(row.dump());
  // A run with a map flies it anew.
  if (then.contains("map"))
    for (const EarlierJson& map : then["map"])
      if (!now.has_map || !clients.contains(map.at("client"))) earlier.maps.push_back(map.dump());
  earlier.complete = then.at("complete") || earlier.rows.empty();
  return earlier;
}

}  // namespace

void TakeEarlierRows(const std::filesystem::path& file, Envelope& envelope) {
  std::map<RowKey, Margin> earlier;
  try {
    const EarlierJson then = EarlierJson::parse(ReadFile(file));
    if (const std::string why = Difference(then, envelope); !why.empty())
      throw UsageError(fmt::format("--resume {}: {}: its rows do not apply to this one", file.string(), why));
    for (const EarlierJson& row : then.at("rows")) {
      if (row.contains("error")) continue;
      earlier[KeyOf(row)] = MarginOf(row);
    }
    envelope.earlier = NotSelected(then, envelope);
  } catch (const UsageError&) {
    throw;
  } catch (const std::exception& error) {
    throw UsageError(
        fmt::format("--resume: {} is not an envelope to continue: {}", file.string(), error.what()));
  }
  for (EnvelopeEntry& entry : envelope.entries) {
    const auto found =
        earlier.find({std::string(entry.row.type->name), entry.row.place, entry.row.side, entry.client});
    if (found != earlier.end()) entry.margin = found->second;
  }
}

}  // namespace tiltproof::harness
