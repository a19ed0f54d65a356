#include "harness/cli/console.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "harness/report/json_text.h"
#include "harness/score/headline.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

std::string Upper(std::string_view text) {
  std::string upper(text);
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return upper;
}

constexpr std::size_t kWordMin = 5;  // PASS, FAIL and ERROR in one column
constexpr std::size_t kNameMin = 16;

// In the middle: both the beginning and the end of a name tell scenarios apart.
std::string Shortened(const std::string& name, std::size_t width) {
  constexpr std::string_view kGap = "..";
  if (name.size() <= width) return name;
  if (width <= kGap.size()) return name.substr(0, width);
  const std::size_t kept = width - kGap.size(), head = (kept + 1) / 2;
  return name.substr(0, head) + std::string(kGap) + name.substr(name.size() - (kept - head));
}

std::string Counted(std::int64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

// Figures after the name in a flight's line; those that it has.
std::vector<std::string> Figures(const Score& score, bool is_short) {
  std::vector<std::string> figures;
  const auto end = score.metrics.end();
  if (const auto flown = score.metrics.find("survival.time_s"); flown != end)
    figures.push_back(fmt::format("{:.1f} s", flown->second));
  if (const auto rmse = score.metrics.find("tracking.rmse_m"); rmse != end)
    figures.push_back(fmt::format("rmse {:.3f} m", rmse->second));
  if (const auto margin = LeastMargin(score)) figures.push_back(fmt::format("margin {:.3g}", *margin));
  std::int64_t activations = 0;
  for (const auto& fault : score.faults) activations += fault.activations;
  if (!score.faults.empty())
    figures.push_back(is_short ? fmt::format("{} act.", activations) : Counted(activations, "activation"));
  if (score.restarts > 0) figures.push_back(Counted(score.restarts, "restart"));
  return figures;
}

// All that kept a flight from passing: first what decided, last what may be the cause of it.
struct Why {
  std::vector<std::string> lines;
  std::string undecided;  // what the early end of a failed flight left open; a line, or empty
};
Why Reasons(const FlightResult& result) {
  const Score& score = result.score;
  Why why{{score.reason}, ""};
  const auto add = [&](const std::string& line) {
    if (line != score.reason) why.lines.push_back(line);
  };
  for (const auto& criterion : score.criteria) {
    if (criterion.verdict == Verdict::kPass) continue;
    if (criterion.verdict == Verdict::kInconclusive && score.verdict != Verdict::kInconclusive)
      why.undecided +=
          (why.undecided.empty() ? "undecided at the end of the flight: " : ", ") + criterion.name;
    else
      add(criterion.name + ": " + criterion.explanation);
  }
  for (const auto& fault : score.faults)
    if (fault.activations == 0) add(NeverActivated(fault, score));
  for (const std::string& cause : OtherCauses(result)) add(cause);
  return why;
}

}  // namespace

Console::Console(bool jsonl)
    : jsonl_(jsonl),
      terminal_(IsTerminal(stdout)),
      indent_(terminal_ ? 6 : 17),
      colours_(terminal_ && std::getenv("NO_COLOR") == nullptr) {}

std::string Console::Paint(const char* colour, const std::string& text) const {
  return colours_ ? fmt::format("\033[{}m{}\033[0m", colour, text) : text;
}

void Console::Line(const std::string& text) const {
  if (!jsonl_) PrintLine(stdout, 0, text);
}

std::string Console::FlightLine(const FlightResult& result) const {
  const Score& score = result.score;
  const std::string name = Plain(result.name);
  const char* colour = result.green() ? "32" : score.verdict == Verdict::kInconclusive ? "33" : "31";
  std::string word = Upper(Name(score.verdict));
  if (score.verdict != Verdict::kPass && result.green()) word += " (expected)";
  std::vector<std::string> figures = Figures(score, terminal_);
  if (!terminal_) return fmt::format("{:<16} {:<36}  {}", word, name, fmt::join(figures, "  "));
  const auto room_for_name = [&] {
    std::size_t taken = std::max(word.size(), kWordMin) + 1;
    for (const auto& figure : figures) taken += 2 + figure.size();
    return taken < kTerminalColumns ? kTerminalColumns - taken : 0;
  };
  // rmse goes before the name can no longer be read.
  if (room_for_name() < std::min(kNameMin, name.size()))
    std::erase_if(figures, [](const auto& figure) { return figure.starts_with("rmse"); });
  const std::size_t room = room_for_name();
  return fmt::format("{} {:<{}}  {}", Paint(colour, fmt::format("{:<{}}", word, kWordMin)),
                     Shortened(name, room), room, fmt::join(figures, "  "));
}

void Console::Finished(const FlightResult& result) const {
  if (jsonl_) {
    Print(stdout, "{}\n", JsonLine(nlohmann::ordered_json::parse(ToJsonText(result))));
    std::fflush(stdout);
    return;
  }
  Print(stdout, "{}\n", OfOurs(FlightLine(result)));
  if (result.green()) {
    if (result.score.verdict != Verdict::kPass) PrintLine(stdout, indent_, result.score.reason);
  } else {
    const Why why = Reasons(result);
    for (const auto& line : why.lines) PrintLine(stdout, indent_, line);
    if (!result.last_lines.empty())
      PrintLine(stdout, indent_, "the last lines that it printed (firmware.log):");
    for (const auto& line : result.last_lines) Print(stdout, "{:{}}{}\n", "", indent_ + 2, line);
    if (!why.undecided.empty() && colours_)
      Print(stdout, "{}\n", OfOurs(Paint("90", InLines(why.undecided, indent_))));
    else if (!why.undecided.empty())
      PrintLine(stdout, indent_, why.undecided);
    const std::string facts = fmt::format("expected {}; seed {}", Name(result.expected), result.seed);
    if (result.replay.empty())
      PrintLine(stdout, indent_, facts);
    else
      Again(facts + "; again:", result.replay);
  }
  std::fflush(stdout);
}

void Console::Again(const std::string& what, const std::string& command) const {
  if (terminal_) {
    PrintLine(stdout, indent_, what);
    PrintCommand(stdout, indent_, command);
  } else {
    PrintLine(stdout, indent_, what + " " + command);
  }
}

void Console::LeftOut(const std::vector<NotApplicable>& scenarios) const {
  if (jsonl_) {
    for (const NotApplicable& scenario : scenarios)
      PrintLine(stderr, 0, fmt::format("not applicable: {}: {}", scenario.name, scenario.reason));
    return;
  }
  std::vector<std::pair<std::string, std::string>> names_of;  // by reason, in the order of the first
  for (const NotApplicable& scenario : scenarios) {
    const auto known = std::ranges::find(names_of, scenario.why, &std::pair<std::string, std::string>::first);
    if (known == names_of.end())
      names_of.emplace_back(scenario.why, scenario.name);
    else
      known->second += ", " + scenario.name;
  }
  for (const auto& [why, names] : names_of) {
    PrintLine(stdout, 0, fmt::format("not applicable: {}", why));
    Print(stdout, "{}\n", TextLines(InLines(names, indent_)));
  }
}

void Console::Repeated(const std::vector<Repeats>& scenarios) const {
  if (jsonl_) return;
  for (const Repeats& repeats : scenarios) {
    const auto [low, high] = WilsonInterval(repeats.passed, repeats.flown);
    const std::string sure =
        repeats.all_the_same
            ? "nothing is drawn at random: every seed is the same flight"
            : fmt::format("{:.3g} % (95 % confidence: {:.3g} to {:.3g} %)",
                          100.0 * static_cast<double>(repeats.passed) / static_cast<double>(repeats.flown),
                          100.0 * low, 100.0 * high);
    PrintLine(
        stdout, 0,
        fmt::format(
            "{}: {} of {} pass, {}{}", repeats.scenario, repeats.passed, repeats.flown, sure,
            repeats.errors == 0 ? "" : ", " + Counted(static_cast<std::int64_t>(repeats.errors), "error")));
    PrintLine(
        stdout, indent_,
        fmt::format("worst: seed {}, {}{}", repeats.worst->seed, Name(repeats.worst->score.verdict),
                    repeats.margin ? fmt::format(", margin {:.3g} of {}", *repeats.margin, repeats.criterion)
                    : repeats.survived_s ? fmt::format(", survived {:.1f} s", *repeats.survived_s)
                                         : ""));
    Again("again:", repeats.worst->replay);
  }
}

void Console::Summary(const std::vector<FlightResult>& results, std::size_t not_flown_count,
                      std::size_t not_applicable_count, bool interrupted,
                      const std::optional<std::filesystem::path>& report) const {
  if (jsonl_) return;
  const auto green =
      std::count_if(results.begin(), results.end(), [](const auto& result) { return result.green(); });
  std::string text = fmt::format("{} of {} green", green, results.size() + not_flown_count);
  if (not_flown_count > 0) text += fmt::format(", {} not flown", not_flown_count);
  if (not_applicable_count > 0) text += fmt::format(", {} not applicable", not_applicable_count);
  if (interrupted) text += " (interrupted)";
  const bool all = not_flown_count == 0 && !interrupted && static_cast<std::size_t>(green) == results.size();
  std::string told = report ? fmt::format("{}; report: {}", text, Plain(report->string())) : text;
  if (terminal_) told = InLines(told, 0);
  // The counts alone have a colour: they are short enough to stand in the first line.
  const bool whole = told.starts_with(text);
  if (whole) told.replace(0, text.size(), Paint(all ? "32" : "31", text));
  Print(stdout, "{}\n", OfOurs(told));
}

}  // namespace tiltproof::harness
