// The program's commands and options as data, read from the table that the registrations make (commands.h). So manual
// pages and completion for shells cannot miss one.
//
//   const CommandRow program = TableOf(app);
//   for (const CommandRow& command : program.commands) Report(command.name, command.help);
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace tiltproof::harness {

struct OptionRow {
  std::vector<std::string> names;  // "-j", "--out"; of an argument without a dash its one name, "PATH"
  bool positional = false;
  bool required = false;
  bool repeatable = false;  // takes any number of values
  std::string value;        // what stands for its value, "N" or "OUT"; empty for a flag
  bool value_optional = false;
  std::vector<std::string> choices;  // all the values that it may have, when there are few
  std::vector<std::string> offered;  // when there are many: what completion offers, and no page lists
  std::string range;                 // "1 - 230", or empty
  std::string initial;               // what it is when it is not given, or empty
  std::string help;                  // may have several lines
};

// The program, or a command in it; without what --help hides.
struct CommandRow {
  std::string name;
  std::string help;
  std::string footer;
  std::vector<OptionRow> options;
  std::vector<CommandRow> commands;
};

CommandRow TableOf(const CLI::App& app);

}  // namespace tiltproof::harness
