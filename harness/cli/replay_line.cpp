#include "harness/cli/replay_line.h"

#include <fmt/format.h>

#include <string_view>

namespace tiltproof::harness {
namespace {

// The word with quotes where a shell needs them.
std::string ShellWordOf(const std::string& word) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+./,:=@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string ReplayLine(const std::string& program, const std::filesystem::path& folder) {
  return fmt::format("{} replay {}", ShellWordOf(program), ShellWordOf(folder.string()));
}

}  // namespace tiltproof::harness
