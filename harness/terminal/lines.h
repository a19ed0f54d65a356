// Text that fits a terminal of 80 columns. Where the output goes elsewhere, each text stays one line: scripts and
// logs read lines.
//
//   PrintLine(stdout, 6, "stays-on-path: always(position_error_m <= 1.0): 1.00084 at 11.640 s");  // on a terminal in several lines, each behind 6 spaces
//   PrintCommand(stdout, 6, "tiltproof replay results/latest/hover");  // the shell reads its lines as one command
#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

namespace tiltproof::harness {

inline constexpr std::size_t kTerminalColumns = 80;

bool IsTerminal(std::FILE* to);

// `text`, plain (terminal.h), in lines of at most `columns`, each behind `indent` spaces. Lines break at spaces only: a
// path that is longer than a line stays whole, so that it can be copied. UTF-8 counts one column per character.
std::string InLines(std::string_view text, std::size_t indent, std::size_t columns = kTerminalColumns);
// The same of a command: all lines but the last end in a backslash, and what stands in quotes stays whole.
std::string CommandInLines(std::string_view command, std::size_t indent,
                           std::size_t columns = kTerminalColumns);

// Each with a line break at its end.
void PrintLine(std::FILE* to, std::size_t indent, std::string_view text);
void PrintCommand(std::FILE* to, std::size_t indent, std::string_view command);

}  // namespace tiltproof::harness
