#include "harness/cli/command_table.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>

namespace tiltproof::harness {
namespace {

// The text between `begin` and `end`, or nothing.
std::string Between(const std::string& text, const std::string& begin, const std::string& end) {
  const auto from = text.find(begin);
  if (from == text.npos) return "";
  const auto to = text.find(end, from + begin.size());
  return to == text.npos ? "" : text.substr(from + begin.size(), to - from - begin.size());
}

// The word for a value that has no name of its own: N for a number, otherwise the option's own name, as OUT for --out.
std::string ValueName(const std::string& type, const OptionRow& row) {
  if (row.positional) return row.names.front();
  if (type == "INT" || type == "UINT" || type == "FLOAT") return "N";
  if (type != "TEXT") return type;
  std::string name = row.names.back().substr(row.names.back().find_first_not_of('-'));
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::toupper(c); });
  return name;
}

// CLI11 keeps a name for the type and descriptions of the checks in one text: "TEXT:{lockstep,realtime}",
// "INT:INT in [1 - 230]".
OptionRow RowOf(const CLI::Option& option) {
  OptionRow row;
  row.positional = option.get_positional();
  if (row.positional) row.names.push_back(option.get_name(true));
  for (const auto& name : option.get_snames()) row.names.push_back("-" + name);
  for (const auto& name : option.get_lnames()) row.names.push_back("--" + name);
  row.required = option.get_required();
  row.help = option.get_description();
  if (option.get_type_size() == 0) return row;
  const std::string type = option.get_type_name();
  row.value = ValueName(type.substr(0, type.find(':')), row);
  row.value_optional = option.get_items_expected_min() == 0;
  row.repeatable = option.get_items_expected_max() >= CLI::detail::expected_max_vector_size;
  row.choices = CLI::detail::split(Between(type, "{", "}"), ',');
  if (row.choices.size() == 1 && row.choices.front().empty()) row.choices.clear();
  if (const std::string range = Between(type, " in [", "]"); !range.empty()) row.range = range;
  row.initial = option.get_default_str();
  return row;
}

}  // namespace

CommandRow TableOf(const CLI::App& app) {
  CommandRow row{.name = app.get_name(),
                 .help = app.get_description(),
                 .footer = app.get_footer(),
                 .options = {},
                 .commands = {}};
  for (const auto* option : app.get_options())
    if (!option->get_group().empty()) row.options.push_back(RowOf(*option));
  for (const auto* command : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!command->get_group().empty()) row.commands.push_back(TableOf(*command));
  return row;
}

}  // namespace tiltproof::harness
