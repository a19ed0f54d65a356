#include "harness/cli/envelope_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "harness/cli/margin_scan.h"
#include "harness/cli/search_flights.h"
#include "harness/report/json_text.h"

namespace tiltproof::harness {
namespace {

using Json = nlohmann::ordered_json;

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

Json PlaceJson(const EnvelopeRow& row) {
  Json json = {{"type", row.type->name}};
  if (!row.place_key.empty()) json[row.place_key] = row.place;
  if (!row.side.empty()) json["side"] = row.side;
  return json;
}

Json EntryJson(const EnvelopeEntry& entry, int repeat_count) {
  const LevelRange& range = entry.severity.range;
  Json json = PlaceJson(entry.row);
  json["client"] = entry.client;
  json["parameter"] = entry.severity.parameter;
  json["survives"] = OrNull(entry.margin->survives);
  json["fails"] = OrNull(entry.margin->fails);
  json["unit"] = entry.severity.unit;
  json["first_criterion"] = nullptr;
  if (entry.margin->fails) {
    json["first_criterion"] = entry.margin->at_fails.criterion;
    json["seed"] = entry.margin->at_fails.seed;
    json["time_s"] = OrNull(entry.margin->at_fails.time_s);
    json["reason"] = entry.margin->at_fails.reason;
  }
  json["harmless"] = OrNull(range.harmless);
  json["mildest"] = range.start;
  json["severest"] = range.end;
  json["scale"] = range.scale == faults::Scale::kLinear ? "linear" : "logarithmic";
  json["runs"] = entry.margin->flights_count;
  AddScan(*entry.margin, repeat_count, json);
  if (entry.margin->unknown) json["error"] = WhyUnknown(*entry.margin->unknown);
  return json;
}

Json AxisJson(const EnvelopeMap::Axis& axis) {
  Json json = PlaceJson(axis.row);
  json["parameter"] = axis.severity.parameter;
  json["unit"] = axis.severity.unit;
  json["levels"] = axis.levels;
  return json;
}

Json MapJson(const EnvelopeMap& map) {
  Json rows = Json::array();
  for (const auto& row : map.survived) {
    Json cells = Json::array();
    for (const std::optional<bool>& cell : row) cells.push_back(cell ? Json(*cell) : Json());
    rows.push_back(std::move(cells));
  }
  return {
      {"client", map.client}, {"x", AxisJson(map.x)}, {"y", AxisJson(map.y)}, {"survived", std::move(rows)}};
}

std::string PlaceText(const EnvelopeRow& row) {
  return row.place + (row.side.empty() ? "" : row.side == "positive" ? "+" : "-");
}

constexpr std::string_view kPocketMark = "*";

std::string Cell(const EnvelopeEntry& entry) {
  if (!entry.margin) return "-";
  if (entry.margin->unknown) return "error";
  if (!entry.margin->survives) return "none";
  if (!entry.margin->fails) return "all";
  return fmt::format("{:.4g}{}", *entry.margin->survives, entry.margin->pockets.empty() ? "" : kPocketMark);
}

constexpr std::size_t kCellColumns = 12;

std::string CellText(const std::string& text) { return fmt::format(" {:>{}}", text, kCellColumns); }

// The heads of the columns. A name that is too long stands above the table, with a number.
std::string Heads(const std::vector<EnvelopeColumn>& columns) {
  std::string names, heads = fmt::format("{:<30} {:<9} {:<13}", "survived up to", "where", "unit");
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string number = fmt::format("[{}]", i + 1);
    const bool fits = columns[i].client.size() <= kCellColumns;
    if (!fits) names += fmt::format("{} {}\n", number, columns[i].client);
    heads += CellText(fits ? columns[i].client : number);
  }
  return names + heads + "\n";
}

std::string AxisName(const EnvelopeMap::Axis& axis) {
  return fmt::format("{}{}{}, {}{}{}", axis.row.type->name, axis.row.place.empty() ? "" : " ", axis.row.place,
                     axis.severity.parameter, axis.severity.unit.empty() ? "" : " in ", axis.severity.unit);
}

}  // namespace

std::string ToJsonText(const Envelope& envelope) {
  Json clients = Json::array(), columns = Json::object();
  for (const auto* group : {&envelope.columns, &envelope.earlier.columns}) {
    for (const EnvelopeColumn& column : *group) {
      clients.push_back(column.client);
      columns[column.client] = {
          {"scenario", column.scenario}, {"flags", column.flags}, {"build", column.build}};
    }
  }
  Json json = {{"format", kResultsFormat},
               {"version", Version()},
               {"scenario", envelope.scenario},
               {"clients", clients},
               {"columns", columns},
               {"seed", envelope.seed},
               {"repeats", envelope.repeat_count},
               {"tolerance", envelope.tolerance},
               {"complete", envelope.complete && envelope.earlier.complete},
               {"rows", Json::array()},
               {"not_applicable", Json::array()}};
  for (const EnvelopeEntry& entry : envelope.entries)
    if (entry.margin) json["rows"].push_back(EntryJson(entry, envelope.repeat_count));
  for (const EnvelopeNotApplicable& other : envelope.not_applicable)
    json["not_applicable"].push_back(
        {{"type", other.type}, {"place", other.place}, {"client", other.client}, {"reason", other.reason}});
  for (const EnvelopeMap& map : envelope.maps) json["map"].push_back(MapJson(map));
  for (const std::string& row : envelope.earlier.rows) json["rows"].push_back(Json::parse(row));
  for (const std::string& row : envelope.earlier.not_applicable)
    json["not_applicable"].push_back(Json::parse(row));
  for (const std::string& map : envelope.earlier.maps) json["map"].push_back(Json::parse(map));
  return JsonText(json, 2) + "\n";
}

std::string EnvelopeTable(const Envelope& envelope) {
  std::string text = Heads(envelope.columns);
  std::vector<std::string> order;
  std::map<std::string, std::map<std::string, const EnvelopeEntry*>> lines;
  for (const EnvelopeEntry& entry : envelope.entries) {
    const std::string line =
        fmt::format("{:<30} {:<9} {:<13}", entry.row.type->name, PlaceText(entry.row), entry.severity.unit);
    if (!lines.contains(line)) order.push_back(line);
    lines[line][entry.client] = &entry;
  }
  for (const std::string& line : order) {
    text += line;
    for (const EnvelopeColumn& column : envelope.columns) {
      const auto found = lines[line].find(column.client);
      text += CellText(found == lines[line].end() ? "n/a" : Cell(*found->second));
    }
    text += "\n";
  }
  const auto has_mark = [](const EnvelopeEntry& entry) {
    return entry.margin && entry.margin->fails && !entry.margin->pockets.empty();
  };
  if (std::any_of(envelope.entries.begin(), envelope.entries.end(), has_mark))
    text +=
        fmt::format("{} survived again at a more severe level: `pockets` in envelope.json\n", kPocketMark);
  return text;
}

std::vector<std::string> NotApplicableLines(const Envelope& envelope) {
  std::vector<std::pair<std::string, std::vector<std::string>>> lines;
  for (const EnvelopeNotApplicable& other : envelope.not_applicable) {
    const std::string line = other.type + ": " + other.reason;
    auto known =
        std::find_if(lines.begin(), lines.end(), [&](const auto& entry) { return entry.first == line; });
    if (known == lines.end()) known = lines.insert(lines.end(), {line, {}});
    std::vector<std::string>& clients = known->second;
    if (std::find(clients.begin(), clients.end(), other.client) == clients.end())
      clients.push_back(other.client);
  }
  std::vector<std::string> texts;
  for (const auto& [line, clients] : lines)
    texts.push_back(fmt::format(
        "not applicable{}: {}",
        clients.size() == envelope.columns.size() ? "" : fmt::format(" to {}", fmt::join(clients, ", ")),
        line));
  return texts;
}

std::string EnvelopeMapText(const EnvelopeMap& map) {
  std::string text = fmt::format("{}: '#' survived, '.' failed\n  up:     {}\n  across: {}\n", map.client,
                                 AxisName(map.y), AxisName(map.x));
  for (std::size_t i = map.survived.size(); i-- > 0;) {
    text += fmt::format("{:>12}  ", fmt::format("{:.4g}", map.y.levels[i]));
    for (const std::optional<bool>& cell : map.survived[i]) text += !cell ? " ?" : *cell ? " #" : " .";
    text += "\n";
  }
  std::vector<std::string> levels;
  for (const double level : map.x.levels) levels.push_back(fmt::format("{:.4g}", level));
  return text + fmt::format("{:>12}   {} ... {}\n", "", levels.front(), levels.back());
}

}  // namespace tiltproof::harness
