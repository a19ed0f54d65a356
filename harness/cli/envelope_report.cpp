#include "harness/cli/envelope_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

namespace tiltproof::harness {
namespace {

std::string PlaceText(const EnvelopeRow& row) {
  return row.place + (row.side.empty() ? "" : row.side == "positive" ? "+" : "-");
}

constexpr std::string_view kPocketMark = "*";

std::string Cell(const EnvelopeSearchRow& row) {
  const std::optional<EnvelopeEntry>& found = row.found;
  if (!found) return "-";
  if (found->never_acted()) return "never acted";
  if (found->error) return "error";
  if (!found->survives) return "none";
  if (!found->fails) return "all";
  return fmt::format("{:.4g}{}", *found->survives, found->pockets.empty() ? "" : kPocketMark);
}

constexpr std::size_t kCellColumns = 12;

std::string CellText(const std::string& text) { return fmt::format(" {:>{}}", text, kCellColumns); }

// The heads of the columns. A name that is too long stands above the table, with a number.
std::string Heads(const std::vector<EnvelopeFirmware>& columns) {
  std::string names, heads = fmt::format("{:<30} {:<9} {:<13}", "survived up to", "where", "unit");
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string number = fmt::format("[{}]", i + 1);
    const bool fits = columns[i].name.size() <= kCellColumns;
    if (!fits) names += fmt::format("{} {}\n", number, columns[i].name);
    heads += CellText(fits ? columns[i].name : number);
  }
  return names + heads + "\n";
}

std::string AxisName(const EnvelopeMap::Axis& axis) {
  return fmt::format("{}{}{}, {}{}{}", axis.type, axis.place().empty() ? "" : " ", axis.place(),
                     axis.parameter, axis.unit.empty() ? "" : " in ", axis.unit);
}

}  // namespace

std::string EnvelopeTable(const EnvelopeSearch& search) {
  std::string text = Heads(search.firmwares());
  std::vector<std::string> order;
  std::map<std::string, std::map<std::string, const EnvelopeSearchRow*>> lines;
  for (const EnvelopeSearchRow& row : search.rows()) {
    const std::string line =
        fmt::format("{:<30} {:<9} {:<13}", row.row.type->name, PlaceText(row.row), row.task.severity.unit);
    if (!lines.contains(line)) order.push_back(line);
    lines[line][row.client] = &row;
  }
  for (const std::string& line : order) {
    text += line;
    for (const EnvelopeFirmware& firmware : search.firmwares()) {
      const auto found = lines[line].find(firmware.name);
      text += CellText(found == lines[line].end() ? "n/a" : Cell(*found->second));
    }
    text += "\n";
  }
  const auto has_mark = [](const EnvelopeSearchRow& row) {
    return row.found && row.found->fails && !row.found->pockets.empty();
  };
  if (std::any_of(search.rows().begin(), search.rows().end(), has_mark))
    text +=
        fmt::format("{} survived again at a more severe level: `pockets` in envelope.json\n", kPocketMark);
  return text;
}

std::vector<std::string> NotApplicableLines(const EnvelopeSearch& search) {
  std::vector<std::pair<std::string, std::vector<std::string>>> lines;
  for (const EnvelopeNotApplicable& other : search.not_applicable()) {
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
        clients.size() == search.firmwares().size() ? "" : fmt::format(" to {}", fmt::join(clients, ", ")),
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
