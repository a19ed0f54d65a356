#include <fmt/format.h>
#include <fmt/ranges.h>

#include "harness/cli/manual.h"

namespace tiltproof::harness {
namespace {

// A word or text in single quotes of a shell.
std::string ShellQuoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

std::string Values(const OptionRow& option) {
  return fmt::format("{}", fmt::join(option.choices.empty() ? option.offered : option.choices, " "));
}

std::string Names(const CommandRow& command) {
  std::vector<std::string> names;
  for (const auto& part : command.commands) names.push_back(part.name);
  return fmt::format("{}", fmt::join(names, " "));
}

// One branch for a place on the command line, which `path` names ("run", "frame encode"; "" is the program itself):
// its options, the values of the one that stands before the cursor, and what goes without a dash.
std::string BashBranch(const std::string& path, const CommandRow& command) {
  std::vector<std::string> options;
  std::string values, words = Names(command);
  for (const auto& option : command.options) {
    if (option.positional) {
      words += Values(option);
      continue;
    }
    options.insert(options.end(), option.names.begin(), option.names.end());
    if (option.value.empty()) continue;
    values += fmt::format("        {}) words={} takes_value=yes ;;\n", fmt::join(option.names, "|"),
                          ShellQuoted(Values(option)));
  }
  std::string branch =
      fmt::format("    {})\n      options={} words={}\n", ShellQuoted(path),
                  ShellQuoted(fmt::format("{}", fmt::join(options, " "))), ShellQuoted(words));
  if (!values.empty()) branch += "      case $previous in\n" + values + "      esac\n";
  branch += "      ;;\n";
  for (const auto& part : command.commands)
    branch += BashBranch(path.empty() ? part.name : path + " " + part.name, part);
  return branch;
}

// Every path of commands, to find the one that has been typed.
void AddPaths(const std::string& above, const CommandRow& command, std::vector<std::string>& paths) {
  for (const auto& part : command.commands) {
    const std::string path = above.empty() ? part.name : above + " " + part.name;
    paths.push_back(ShellQuoted(path));
    AddPaths(path, part, paths);
  }
}

// A text within [] or between the colons of a specification of _arguments: its first line.
std::string ZshText(const std::string& text) {
  std::string escaped;
  for (const char c : text.substr(0, text.find('\n'))) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string ZshValue(const OptionRow& option) {
  const std::string values = Values(option);
  return fmt::format("{}:{}", ZshText(option.value), values.empty() ? "_files" : "(" + values + ")");
}

std::string ZshOption(const OptionRow& option, int position) {
  if (option.positional)
    return " \\\n    " +
           ShellQuoted((option.repeatable ? "*" : std::to_string(position)) + ":" + ZshValue(option));
  std::string specifications;
  for (const auto& name : option.names) {
    std::string text = "*" + name;
    if (!option.value.empty()) text += name.starts_with("--") ? "=" : "+";
    text += fmt::format("[{}]", ZshText(option.help));
    if (!option.value.empty()) text += (option.value_optional ? "::" : ":") + ZshValue(option);
    specifications += " \\\n    " + ShellQuoted(text);
  }
  return specifications;
}

// A function for a command, and those of its own commands.
std::string ZshFunction(const std::string& name, const CommandRow& command) {
  std::string parts, text = fmt::format("{}() {{\n  local line state\n  _arguments -C", name);
  int position = 0;
  for (const auto& option : command.options) text += ZshOption(option, option.positional ? ++position : 0);
  if (command.commands.empty()) return text + "\n}\n\n";
  text +=
      " \\\n    '1: :->command' \\\n    '*:: :->arguments'\n  case $state in\n    command)\n      local -a "
      "commands=(";
  for (const auto& part : command.commands)
    text += "\n        " + ShellQuoted(part.name + ":" + ZshText(part.help));
  text += ")\n      _describe command commands ;;\n    arguments)\n      case $line[1] in\n";
  for (const auto& part : command.commands) {
    const std::string function = name + "_" + part.name;
    text += fmt::format("        {}) {} ;;\n", part.name, function);
    parts += ZshFunction(function, part);
  }
  return parts + text + "      esac ;;\n  esac\n}\n\n";
}

}  // namespace

std::string BashCompletion(const CommandRow& program) {
  std::vector<std::string> paths;
  AddPaths("", program, paths);
  const std::string function = "_" + program.name;
  return fmt::format(
             R"(# Completion of {} for bash. Written by the program itself, from its table of options.
{}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}} path= word options= words= takes_value=
  # bash makes "--mode=lock" three words.
  if [[ $current == "=" ]]; then
    current=
  elif [[ $previous == "=" ]]; then
    previous=${{COMP_WORDS[COMP_CWORD - 2]}}
  fi
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case "${{path:+$path }}$word" in
      {}) path=${{path:+$path }}$word ;;
      *) break ;;
    esac
  done
  case $path in
)",
             program.name, function, fmt::join(paths, " | ")) +
         BashBranch("", program) +
         fmt::format(R"(  esac
  [[ $current == -* && -z $takes_value ]] && words=$options
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}}
complete -o bashdefault -o default -F {} {}
)",
                     function, program.name);
}

std::string ZshCompletion(const CommandRow& program) {
  return fmt::format(
      "#compdef {0}\n# Completion of {0} for zsh. Written by the program itself, from its table of "
      "options.\n\n"
      "{1}_{0} \"$@\"\n",
      program.name, ZshFunction("_" + program.name, program));
}

}  // namespace tiltproof::harness
