#include "harness/terminal/lines.h"

#include <unistd.h>

#include <vector>

#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

std::size_t ColumnsOf(std::string_view text) {
  std::size_t count = 0;
  for (const char c : text) count += (static_cast<unsigned char>(c) & 0xC0U) != 0x80 ? 1 : 0;
  return count;
}

// Several spaces make empty words, so that none is lost. Those in quotes part nothing, where `quotes` count.
std::vector<std::string> Words(std::string_view text, bool quotes) {
  std::vector<std::string> words(1);
  bool quoted = false;
  for (const char c : text) {
    quoted = quoted != (quotes && c == '\'');
    if (c == ' ' && !quoted)
      words.emplace_back();
    else
      words.back() += c;
  }
  return words;
}

// `end` stands behind each line but the last.
std::string Broken(const std::vector<std::string>& words, std::size_t indent, std::size_t columns,
                   std::string_view end) {
  const std::string margin(indent, ' ');
  std::string text = margin, line = words.front();
  for (std::size_t i = 1; i < words.size(); ++i) {
    if (indent + ColumnsOf(line) + 1 + ColumnsOf(words[i]) + end.size() > columns) {
      text.append(line).append(end).append("\n").append(margin);
      line = words[i];
    } else {
      line += " " + words[i];
    }
  }
  return text + line;
}

}  // namespace

bool IsTerminal(std::FILE* to) { return isatty(fileno(to)) != 0; }

std::string InLines(std::string_view text, std::size_t indent, std::size_t columns) {
  return Broken(Words(Plain(text), false), indent, columns, "");
}

std::string CommandInLines(std::string_view command, std::size_t indent, std::size_t columns) {
  return Broken(Words(Plain(command), true), indent, columns, " \\");
}

void PrintLine(std::FILE* to, std::size_t indent, std::string_view text) {
  if (IsTerminal(to))
    Print(to, "{}\n", TextLines(InLines(text, indent)));
  else
    Print(to, "{:{}}{}\n", "", indent, std::string(text));
}

void PrintCommand(std::FILE* to, std::size_t indent, std::string_view command) {
  if (IsTerminal(to))
    Print(to, "{}\n", TextLines(CommandInLines(command, indent)));
  else
    Print(to, "{:{}}{}\n", "", indent, std::string(command));
}

}  // namespace tiltproof::harness
