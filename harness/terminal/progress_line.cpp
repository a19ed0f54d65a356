#include "harness/terminal/progress_line.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// A line that fills the last column would wrap.
std::size_t RoomOnStandardError() {
  winsize size{};
  const bool known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return (known ? std::min<std::size_t>(size.ws_col, kTerminalColumns) : kTerminalColumns) - 1;
}

}  // namespace

ProgressLine::ProgressLine(bool wanted) : visible_(wanted && IsTerminal(stderr)) {}

void ProgressLine::Show(const std::string& text) {
  if (!visible_) return;
  std::string line = Plain(text);
  std::size_t end = std::min(line.size(), RoomOnStandardError());
  while (end > 0 && end < line.size() && (static_cast<unsigned char>(line[end]) & 0xC0U) == 0x80) --end;
  line.resize(end);
  if (line == shown_) return;
  Print(stderr, "{}", OfOurs("\r\033[K" + line));
  std::fflush(stderr);
  shown_ = line;
}

void ProgressLine::Clear() {
  if (!shown_.empty()) Print(stderr, "{}", OfOurs("\r\033[K"));
  shown_.clear();
}

std::optional<double> TimeLeft(double share, double passed_s) {
  constexpr double kShareMin = 1e-3, kPassedMin_s = 1.0;
  if (share < kShareMin || passed_s < kPassedMin_s) return std::nullopt;
  return passed_s * std::max(0.0, 1.0 - share) / share;
}

std::string DurationText(double seconds) {
  const auto whole = static_cast<long long>(std::ceil(std::clamp(seconds, 0.0, 1e12)));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  const long long minutes = (whole + 59) / 60;
  return fmt::format("{} h {} min", minutes / 60, minutes % 60);
}

}  // namespace tiltproof::harness
