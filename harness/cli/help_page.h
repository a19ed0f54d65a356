// The pages that `--help` and `tiltproof help` print, from the table of commands and options: at most 100 columns wide.
#pragma once

#include <string>

#include "harness/cli/command_table.h"

namespace tiltproof::harness {

// `typed`: how the command is called. Ends in a line break.
std::string HelpPage(const std::string& typed, const CommandRow& command);

}  // namespace tiltproof::harness
