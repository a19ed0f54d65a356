#include "harness/cli/scenario_comment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <system_error>

#include "harness/cli/commands.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {

std::string Comment(const std::string& text) {
  constexpr std::size_t kColumns = 110;
  std::string lines, line = "#";
  std::size_t from = 0;
  const std::string plain = Plain(text);
  while (from < plain.size()) {
    const std::size_t to = std::min(plain.find(' ', from), plain.size());
    if (line.size() > 1 && line.size() + 1 + to - from > kColumns) {
      lines += line + '\n';
      line = "#  ";
    }
    line += ' ' + plain.substr(from, to - from);
    from = to + 1;
  }
  return lines + line + '\n';
}

void CheckOwnFile(const std::filesystem::path& out, std::string_view first_words) {
  std::error_code error;
  if (!std::filesystem::exists(std::filesystem::symlink_status(out, error))) return;
  std::string begin(first_words.size(), '\0');
  std::ifstream file(out);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (begin != first_words)
    throw UsageError(
        fmt::format("--out {}: something else is there; remove it, or name another file", out.string()));
}

}  // namespace tiltproof::harness
