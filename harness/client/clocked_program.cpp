#include "harness/client/clocked_program.h"

#include <elf.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/client/firmware_files.h"
#include "harness/client/preload/launchers.h"

namespace tiltproof::harness {
namespace {

// The file that a shell would run; empty: there is none.
std::filesystem::path Found(const std::string& word) {
  if (word.find('/') != std::string::npos) return access(word.c_str(), X_OK) == 0 ? word : "";
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');)
    if (const auto file = std::filesystem::path(folder.empty() ? "." : folder) / word;
        access(file.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(file))
      return file;
  return "";
}

struct ShellWord {
  std::string text;      // without quotes
  bool expands = false;  // the shell puts something else in its place
};

// Words of a command, as a shell reads them. Empty: it is more than one program.
std::vector<ShellWord> WordsOf(const std::string& command) {
  std::vector<ShellWord> words;
  bool in_word = false;
  char quote = '\0';
  const auto has = [](const char* set, char c) { return std::strchr(set, c) != nullptr; };
  for (std::size_t i = 0; i < command.size(); ++i) {
    const char c = command[i];
    const bool escapes = c == '\\' && quote != '\'' && i + 1 < command.size();
    const bool redirects = c == '&' && i > 0 && command[i - 1] == '>';
    if (quote == '\0' && !escapes) {
      if (has(";&|()`\n", c) && !redirects) return {};
      if (has(" \t<>&", c)) {
        in_word = false;
        continue;
      }
    }
    if (!std::exchange(in_word, true)) words.emplace_back();
    ShellWord& word = words.back();
    if (escapes) {
      // Within double quotes, a backslash before anything else stays.
      if (quote == '"' && !has("\"\\$`\n", command[i + 1])) word.text += c;
      word.text += command[++i];
    } else if (quote == '\0' ? has("'\"", c) : c == quote) {
      quote = quote == '\0' ? c : '\0';
    } else {
      word.expands = word.expands || has(quote == '\0' ? "$*?[~#" : quote == '"' ? "$`" : "", c);
      word.text += c;
    }
  }
  return words;
}

// The place of the program among the words, behind the variables that are set for it.
std::size_t ProgramAt(const std::vector<ShellWord>& words) {
  const auto program = std::find_if(words.begin(), words.end(), [](const ShellWord& word) {
    return word.text.find('=') == std::string::npos;
  });
  return static_cast<std::size_t>(program - words.begin());
}

// The first word that is a program's; empty: only the shell knows it.
std::string ProgramWord(const std::string& command) {
  const std::vector<ShellWord> words = WordsOf(command);
  std::size_t at = ProgramAt(words);
  if (at < words.size() && words[at].text == "exec") ++at;
  return at >= words.size() || words[at].expands ? "" : words[at].text;
}

std::optional<std::string> MistakeOf(const std::filesystem::path& file, int depth);

// A script is run by what its first line names.
std::optional<std::string> ScriptMistake(const std::string& first_line, int depth) {
  std::istringstream words(first_line.substr(2));
  std::string interpreter, argument;
  words >> interpreter >> argument;
  if (std::filesystem::path(interpreter).filename() == "env" && !argument.empty() && argument[0] != '-')
    interpreter = Found(argument).string();
  if (interpreter.empty() || depth == 0) return std::nullopt;
  return MistakeOf(interpreter, depth - 1);
}

bool HasInterpreter(std::ifstream& in, const Elf64_Ehdr& header) {
  for (int i = 0; i < header.e_phnum; ++i) {
    Elf64_Phdr segment{};
    in.seekg(static_cast<std::streamoff>(header.e_phoff) +
             static_cast<std::streamoff>(i) * header.e_phentsize);
    if (!in.read(reinterpret_cast<char*>(&segment), sizeof segment)) return false;
    if (segment.p_type == PT_INTERP) return true;
  }
  return false;
}

std::optional<std::string> MistakeOf(const std::filesystem::path& file, int depth) {
  if (file.empty() || IsLauncher(file.filename().string())) return std::nullopt;
  struct stat status {};
  if (stat(file.c_str(), &status) != 0) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  Elf64_Ehdr header{};
  in.read(reinterpret_cast<char*>(&header), sizeof header);
  const std::string_view begin(reinterpret_cast<const char*>(&header), static_cast<std::size_t>(in.gcount()));
  if (begin.starts_with("#!")) {
    std::ifstream text(file);
    std::string line;
    std::getline(text, line);
    return ScriptMistake(line, depth);
  }
  if ((status.st_mode & (S_ISUID | S_ISGID)) != 0 ||
      getxattr(file.c_str(), "security.capability", nullptr, 0) > 0)
    return fmt::format(
        "{} is set-user-ID, set-group-ID or has capabilities, so that the linker preloads nothing into it; "
        "use a copy without (cp)",
        file.string());
  if (!begin.starts_with(ELFMAG) || begin.size() < sizeof header) return std::nullopt;
  if (header.e_ident[EI_CLASS] != ELFCLASS64 || header.e_machine != EM_X86_64)
    return fmt::format("{} is not for this processor, x86-64; the virtual clock holds no other",
                       file.string());
  if (!HasInterpreter(in, header))
    return fmt::format(
        "{} is statically linked, so that the virtual clock cannot be loaded into it; link it dynamically "
        "(without -static), or fly it with process: and --mode realtime",
        file.string());
  return std::nullopt;
}

}  // namespace

std::string Executed(const std::string& command) {
  const std::vector<ShellWord> words = WordsOf(command);
  const std::size_t at = ProgramAt(words);
  if (at == words.size() || words[at].text == "exec") return command;
  // One that the shell does not know as a file is part of its language.
  if (!words[at].expands && Found(words[at].text).empty()) return command;
  return (at > 0 ? "exec env " : "exec ") + command;
}

std::filesystem::path ClockLibrary() { return ShippedLibrary("libtiltproof_clock.so"); }

std::optional<std::string> ClockMistake(const std::string& command) {
  if (!std::filesystem::exists(ClockLibrary()))
    return "this build has no virtual clock: it needs Linux on x86-64";
  const std::string word = ProgramWord(command);
  return word.empty() ? std::nullopt : MistakeOf(Found(word), 1);
}

}  // namespace tiltproof::harness
