#include "harness/cli/console.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

namespace tiltproof::harness {
namespace {

std::string Upper(std::string_view text) {
  std::string upper(text);
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return upper;
}

}  // namespace

Console::Console(bool jsonl)
    : jsonl_(jsonl), colours_(isatty(STDOUT_FILENO) != 0 && std::getenv("NO_COLOR") == nullptr) {}

std::string Console::Paint(const char* colour, const std::string& text) const {
  return colours_ ? fmt::format("\033[{}m{}\033[0m", colour, text) : text;
}

void Console::Line(const std::string& text) const {
  if (!jsonl_) fmt::print("{}\n", text);
}

void Console::Finished(const ScenarioResult& result) const {
  if (jsonl_) {
    fmt::print("{}\n", nlohmann::ordered_json::parse(ToJsonText(result)).dump());
    std::fflush(stdout);
    return;
  }
  const Score& score = result.score;
  const char* colour = result.green() ? "32" : score.verdict == Verdict::kInconclusive ? "33" : "31";
  std::string numbers;
  const auto metric = [&](const char* name, const char* label, const char* unit) {
    if (const auto found = score.metrics.find(name); found != score.metrics.end())
      numbers += fmt::format("  {} {:.3f} {}", label, found->second, unit);
  };
  metric("survival.time_s", "flew", "s");
  metric("tracking.rmse_m", "rmse", "m");
  metric("tracking.max_error_m", "max", "m");
  if (score.restarts_count > 0)
    numbers += fmt::format("  {} restart{}", score.restarts_count, score.restarts_count == 1 ? "" : "s");
  if (result.real_time_factor > 0) numbers += fmt::format("  {:.0f}x real time", result.real_time_factor);
  std::string word = Upper(Name(score.verdict));
  if (score.verdict != Verdict::kPass && result.green()) word += " (expected)";
  fmt::print("{} {:<36}{}\n", Paint(colour, fmt::format("{:<16}", word)), result.name, numbers);
  if (score.verdict != Verdict::kPass || !result.green()) {
    fmt::print("                 {}\n", score.reason);
    if (!result.green()) {
      fmt::print("                 expected {}; seed {}{}{}\n", Name(result.expected), result.seed,
                 result.replay.empty() ? "" : "; again: ", result.replay);
    }
  }
  std::fflush(stdout);
}

void Console::LeftOut(const NotApplicable& scenario) const {
  fmt::print(jsonl_ ? stderr : stdout, "not applicable: {}: {}\n", scenario.name, scenario.reason);
}

void Console::Summary(const std::vector<ScenarioResult>& results, std::size_t not_flown_count,
                      std::size_t not_applicable_count, bool interrupted) const {
  if (jsonl_) return;
  const auto green =
      std::count_if(results.begin(), results.end(), [](const auto& result) { return result.green(); });
  std::string text = fmt::format("{} of {} green", green, results.size() + not_flown_count);
  if (not_flown_count > 0) text += fmt::format(", {} not flown", not_flown_count);
  if (not_applicable_count > 0) text += fmt::format(", {} not applicable", not_applicable_count);
  if (interrupted) text += " (interrupted)";
  const bool all = not_flown_count == 0 && !interrupted && static_cast<std::size_t>(green) == results.size();
  fmt::print("{}\n", Paint(all ? "32" : "31", text));
}

}  // namespace tiltproof::harness
