#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

#include "harness/cli/manual.h"
#include "harness/report/results.h"

namespace tiltproof::harness {
namespace {

// Text of a page. roff reads backslashes, and a line that begins with a dot or a quote, as commands; a plain hyphen may be
// set as a dash.
std::string Roff(const std::string& text) {
  std::string roff;
  bool line_begins = true;
  for (const char c : text) {
    if (line_begins && c == ' ') continue;
    if (line_begins && (c == '.' || c == '\'')) roff += "\\&";
    line_begins = c == '\n';
    if (c == '\\')
      roff += "\\e";
    else if (c == '-')
      roff += "\\-";
    else if (c == '\'')
      roff += "\\(aq";
    else if (c == '`')
      roff += "\\(ga";
    else
      roff += c;
  }
  return roff;
}

// Lines as they are: each a line of the page, in a list of its own indentation.
std::string Paragraphs(const std::string& text) {
  std::string roff;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if (!roff.empty()) roff += ".br\n";
    if (const std::string line = Roff(text.substr(at, end - at)); !line.empty()) roff += line + "\n";
    at = end + 1;
  }
  return roff;
}

std::string Heading(const std::string& name, const std::string& help, const std::string& date) {
  std::string upper = name;
  std::transform(upper.begin(), upper.end(), upper.begin(), [](unsigned char c) { return std::toupper(c); });
  return fmt::format(
      ".TH {} 1 {} \"tiltproof {}\" \"tiltproof\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n.nh\n.ad l\n",
      Roff(upper), date, Roff(std::string(Version())), Roff(name), Roff(help));
}

// The words to type: the name, its options, its arguments.
std::string Synopsis(const std::string& typed, const CommandRow& command) {
  std::string text = fmt::format("\\fB{}\\fR", Roff(typed));
  if (std::any_of(command.options.begin(), command.options.end(),
                  [](const auto& o) { return !o.positional; }))
    text += " [\\fIOPTIONS\\fR]";
  for (const auto& option : command.options) {
    if (!option.positional) continue;
    text += fmt::format(fmt::runtime(option.required ? " \\fI{}\\fR{}" : " [\\fI{}\\fR{}]"),
                        Roff(option.value), option.repeatable ? "..." : "");
  }
  if (!command.commands.empty()) text += " \\fICOMMAND\\fR";
  return text + "\n";
}

std::string Options(const CommandRow& command) {
  std::string text;
  for (const auto& option : command.options) {
    text += fmt::format(".TP\n\\fB{}\\fR", Roff(fmt::format("{}", fmt::join(option.names, ", "))));
    if (!option.positional && !option.value.empty())
      text += fmt::format(fmt::runtime(option.value_optional ? " [\\fI{}\\fR]" : " \\fI{}\\fR"),
                          Roff(option.value));
    text += fmt::format("\n{}", Paragraphs(option.help));
    if (!option.choices.empty())
      text += fmt::format(".br\nOne of: {}.\n", Roff(fmt::format("{}", fmt::join(option.choices, ", "))));
    if (!option.range.empty()) text += fmt::format(".br\nRange: {}.\n", Roff(option.range));
    if (!option.initial.empty()) text += fmt::format(".br\nDefault: {}.\n", Roff(option.initial));
    if (option.required && !option.positional) text += ".br\nRequired.\n";
  }
  return text;
}

constexpr const char* kExitStatus =
    ".SH EXIT STATUS\n"
    ".TP\n0\nAll as expected.\n"
    ".TP\n1\nSomething was not.\n"
    ".TP\n2\nWrong usage, or a mistake in a file.\n"
    ".TP\n3\nA failure of the harness.\n"
    ".TP\n4\nNothing selected, nothing that applies, or undecided.\n"
    ".TP\n130\nInterrupted.\n";

std::string CommandPage(const std::string& program, const CommandRow& command, const std::string& date) {
  std::string page = Heading(program + "-" + command.name, command.help, date);
  const std::string typed = program + " " + command.name;
  if (command.commands.empty()) page += Synopsis(typed, command);
  for (const auto& part : command.commands)
    page += (&part == &command.commands.front() ? "" : ".br\n") + Synopsis(typed + " " + part.name, part);
  page += ".SH OPTIONS\n" + Options(command);
  for (const auto& part : command.commands)
    page += fmt::format(".SS {}\n{}{}", Roff(typed + " " + part.name), Paragraphs(part.help), Options(part));
  if (!command.footer.empty()) page += ".SH NOTES\n" + Paragraphs(command.footer);
  return page + kExitStatus + fmt::format(".SH SEE ALSO\n.BR {} (1)\n", Roff(program));
}

}  // namespace

std::map<std::string, std::string> ManualPages(const CommandRow& program, const std::string& date) {
  std::map<std::string, std::string> pages;
  const auto colon = program.help.find(": ");
  std::string page =
      Heading(program.name, colon == program.help.npos ? program.help : program.help.substr(colon + 2), date);
  page += Synopsis(program.name, program) + ".SH OPTIONS\n" + Options(program) + ".SH COMMANDS\n";
  for (const auto& command : program.commands) {
    const std::string name = program.name + "-" + command.name;
    pages[name + ".1"] = CommandPage(program.name, command, date);
    page += fmt::format(".TP\n.BR {} (1)\n{}", Roff(name), Paragraphs(command.help));
  }
  page += kExitStatus;
  page +=
      ".SH FILES\n"
      ".TP\n\\fI../share/tiltproof\\fR\nBeside the program\\(aqs folder: models, scenarios and examples.\n"
      ".TP\n\\fI../share/doc/tiltproof\\fR\nThe documentation; it begins with README.md.\n"
      ".TP\n\\fIresults/latest\\fR\nBelow the working folder: the files of the last run.\n";
  pages[program.name + ".1"] = page;
  return pages;
}

}  // namespace tiltproof::harness
