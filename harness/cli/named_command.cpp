#include "harness/cli/named_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string_view>

#include "harness/cli/command_table.h"
#include "harness/cli/commands.h"
#include "harness/cli/help_page.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

bool TakesArguments(const CLI::App& app) {
  const auto options = app.get_options();
  return std::any_of(options.begin(), options.end(),
                     [](const CLI::Option* option) { return option->get_positional(); });
}

}  // namespace

NamedCommand FindCommand(const CLI::App& app, const std::vector<std::string>& arguments) {
  NamedCommand command{.app = &app, .typed = app.get_name(), .trouble = {}};
  for (const std::string& argument : arguments) {
    const auto commands = command.app->get_subcommands([](const CLI::App*) { return true; });
    if (commands.empty() || argument.starts_with('-')) break;
    std::vector<std::string> names;
    for (const auto* known : commands) names.push_back(known->get_name());
    const auto found = std::find(names.begin(), names.end(), argument);
    // `campaign FILE` stands beside `campaign show`.
    if (found == names.end() && TakesArguments(*command.app)) break;
    if (found == names.end()) {
      const std::string hint =
          DidYouMean(argument, std::vector<std::string_view>(names.begin(), names.end()));
      command.trouble = command.typed + ": unknown command '" + argument + "'" +
                        (hint.empty() ? "; all commands: " + command.typed + " --help" : hint);
      break;
    }
    command.app = commands[static_cast<std::size_t>(found - names.begin())];
    command.typed += " " + argument;
  }
  return command;
}

std::string Mistake(const NamedCommand& command, const CLI::ParseError& error) {
  const std::string more = "; `" + command.typed + " --help` says more";
  const std::vector<std::string> rest = command.app->remaining();
  if (dynamic_cast<const CLI::ExtrasError*>(&error) == nullptr || rest.empty())
    return command.typed + ": " + error.what() + more;
  if (!rest.front().starts_with('-'))
    return command.typed + ": one argument too many: '" + rest.front() + "'" + more;
  const CommandRow table = TableOf(*command.app);
  std::vector<std::string_view> names;
  for (const OptionRow& option : table.options)
    if (!option.positional) names.insert(names.end(), option.names.begin(), option.names.end());
  const std::string typed = rest.front().substr(0, rest.front().find('='));
  const std::string_view meant = ClosestName(typed, names);
  return command.typed + ": unknown option '" + typed + "'" +
         (meant.empty() ? more : "; did you mean '" + std::string(meant) + "'?");
}

int PrintHelp(const NamedCommand& command) {
  Print(stdout, "{}", TextLines(HelpPage(command.typed, TableOf(*command.app))));
  return kExitGreen;
}

}  // namespace tiltproof::harness
