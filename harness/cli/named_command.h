// The command that a command line names, its help, and what is wrong with the rest of the line.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace tiltproof::harness {

// The command line begins with the names of a command and, if it has any, of one of its own.
struct NamedCommand {
  const CLI::App* app;
  std::string typed;    // "tiltproof frame encode"
  std::string trouble;  // the message when a name is unknown; then `app` is what lacks it
};

// `arguments`: without the program's name.
NamedCommand FindCommand(const CLI::App& app, const std::vector<std::string>& arguments);

// The reason why the arguments of a command cannot be read, in one line.
std::string Mistake(const NamedCommand& command, const CLI::ParseError& error);

// Prints the command's help. Returns the exit code.
int PrintHelp(const NamedCommand& command);

}  // namespace tiltproof::harness
