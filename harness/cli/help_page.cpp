#include "harness/cli/help_page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>

#include "harness/terminal/lines.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kColumns = 100;
constexpr std::size_t kIndent = 2;
// The column in which descriptions begin. A longer name has a line of its own.
constexpr std::size_t kTextColumn = 24;

std::string ValueOf(const OptionRow& option) {
  if (option.value.empty()) return {};
  const std::string value =
      option.choices.empty() ? option.value : fmt::format("{}", fmt::join(option.choices, "|"));
  return option.value_optional ? fmt::format(" [{}]", value) : " " + value;
}

std::string NameOf(const OptionRow& option) {
  if (option.positional) return option.value + (option.repeatable ? "..." : "");
  return fmt::format("{}", fmt::join(option.names, ", ")) + ValueOf(option);
}

std::string TextOf(const OptionRow& option) {
  std::string notes;
  const auto note = [&notes](const std::string& text) { notes += (notes.empty() ? "" : "; ") + text; };
  if (option.required && !option.positional) note("required");
  if (!option.range.empty()) note(option.range);
  if (!option.initial.empty()) note("default: " + option.initial);
  if (notes.empty()) return option.help;
  // Behind the first line: the others are a list.
  const std::size_t end = std::min(option.help.find('\n'), option.help.size());
  return fmt::format("{} ({}){}", option.help.substr(0, end), notes, option.help.substr(end));
}

// The name, then the text in the column of texts. Lines of the text that begin with spaces stand further in.
std::string Entry(const std::string& name, const std::string& text) {
  std::string entry = std::string(kIndent, ' ') + name;
  const bool beside = entry.size() + 1 < kTextColumn;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::size_t from = std::min(text.find_first_not_of(' ', at), end);
    const std::string lines =
        InLines(std::string_view(text).substr(from, end - from), kTextColumn + from - at, kColumns);
    if (at == 0 && beside)
      entry += lines.substr(std::min(entry.size(), lines.size()));
    else
      entry += "\n" + lines;
    at = end + 1;
  }
  return entry + "\n";
}

}  // namespace

std::string HelpPage(const std::string& typed, const CommandRow& command) {
  std::string usage = typed, arguments, options, commands;
  for (const OptionRow& option : command.options) {
    (option.positional ? arguments : options) += Entry(NameOf(option), TextOf(option));
    if (!option.positional && option.required) usage += " " + option.names.front() + ValueOf(option);
  }
  for (const CommandRow& part : command.commands) commands += Entry(part.name, part.help);
  if (!options.empty()) usage += " [OPTIONS]";
  for (const OptionRow& option : command.options)
    if (option.positional)
      usage += option.required ? " " + NameOf(option) : fmt::format(" [{}]", NameOf(option));
  if (!commands.empty()) usage += " COMMAND ...";

  std::string page = InLines(command.help, 0, kColumns) + "\n\nUsage: " + usage + "\n";
  if (!arguments.empty()) page += "\nArguments:\n" + arguments;
  if (!commands.empty()) page += "\nCommands:\n" + commands;
  if (!options.empty()) page += "\nOptions:\n" + options;
  if (!command.footer.empty()) page += "\n" + InLines(command.footer, 0, kColumns) + "\n";
  if (!commands.empty()) page += fmt::format("\n`{} COMMAND --help` says more of one.\n", typed);
  return page;
}

}  // namespace tiltproof::harness
