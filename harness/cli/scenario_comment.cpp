#include "harness/cli/scenario_comment.h"

#include <algorithm>
#include <cstddef>

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

}  // namespace tiltproof::harness
