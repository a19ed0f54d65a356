// Manual pages (for `man`) and completion (for bash and zsh) of a program, from its table of commands and options.
//
//   for (const auto& [name, text] : ManualPages(program, "2026-11-23")) Write(name, text);   // "tiltproof-run.1"
//   Write("tiltproof.bash", BashCompletion(program));
//   Write("_tiltproof", ZshCompletion(program));
#pragma once

#include <map>
#include <string>

#include "harness/cli/command_table.h"

namespace tiltproof::harness {

// File names and texts (roff, macros man(7)): one for the program, which lists its commands, and one for each command.
// `date` is that of the pages, YYYY-MM-DD.
std::map<std::string, std::string> ManualPages(const CommandRow& program, const std::string& date);

// Options, commands, and values where there are few; otherwise the shell completes files.
std::string BashCompletion(const CommandRow& program);
std::string ZshCompletion(const CommandRow& program);

}  // namespace tiltproof::harness
