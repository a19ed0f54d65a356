#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <memory>
#include <utility>

#include "harness/campaign/envelope_search.h"
#include "harness/campaign/envelope_sides.h"
#include "harness/cli/envelope_flights.h"
#include "harness/cli/envelope_plan.h"
#include "harness/cli/envelope_report.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/report_command.h"
#include "harness/cli/search_flights.h"
#include "harness/report/files.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/progress_line.h"
#include "harness/terminal/terminal.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

// A search, its files and its output.
class EnvelopeRun {
 public:
  EnvelopeRun(const EnvelopeOptions& options, EnvelopePlan plan)
      : options_(options),
        search_(std::move(plan),
                {.tolerance = options.tolerance,
                 .repeat_count = options.repeat_count,
                 .flights = {.jobs_count = options.jobs_count,
                             .interrupted = InterruptScope::flag(),
                             .tell = [this](const std::string& line) { Tell("tiltproof: " + line); },
                             .on_turn = [this] { ShowProgress(); }},
                 .on_row = [this](const EnvelopeSearchRow& row) { Take(row); },
                 .on_unknown = [this](const TrialResult& unknown) { OnUnknown(unknown); }}),
        line_(!options.no_progress) {
    if (!options.resume.empty()) Resume(options.resume / "envelope.json");
  }

  // The exit code.
  int Run() {
    if (search_.rows().empty()) {
      PrintNotApplicable();
      Print(stderr, "tiltproof: nothing is left to fly with this client\n");
      return kExitUndecided;
    }
    LockFolder();
    Write();
    search_.Run();
    line_.Clear();
    Write();
    PrintResults();
    const std::vector<SideFlight> sides = SidesOf(search_.rows());
    WriteLevels(folder(), sides);
    if (options_.keep && !interrupted()) Keep(sides);
    if (!options_.no_report)
      if (const auto page = WriteEnvelopeReport(folder(), options_.command.front()))
        PrintLine(stdout, 0, "report: " + page->string());
    Print(stdout, "{} of {} rows, {} flight{}, in {}{}\n", search_.done_count(), search_.rows().size(),
          search_.flown_count(), search_.flown_count() == 1 ? "" : "s", (folder() / "envelope.json").string(),
          interrupted() ? " (interrupted)" : "");
    return interrupted() ? static_cast<int>(kExitInterrupted) : exit_;
  }

 private:
  void Resume(const std::filesystem::path& file) {
    Envelope earlier;
    try {
      earlier = ReadEnvelope(file);
    } catch (const std::exception& error) {
      throw UsageError(
          fmt::format("--resume: {} is not an envelope to continue: {}", file.string(), error.what()));
    }
    try {
      search_.Resume(earlier);
    } catch (const std::runtime_error& difference) {
      throw UsageError(fmt::format("--resume {}: {}: its rows do not apply to this one", file.string(),
                                   difference.what()));
    }
  }

  // For this process alone, and not over another envelope.
  void LockFolder() {
    std::filesystem::create_directories(folder());
    lock_ = link::OwnedDescriptor(open(folder().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
      throw UsageError(fmt::format("{}: another envelope is being written there; choose another --out",
                                   folder().string()));
    if (options_.resume.empty() && std::filesystem::exists(folder() / "envelope.json"))
      throw UsageError(
          fmt::format("{} holds an envelope already: continue it (--resume {}), or choose another --out",
                      folder().string(), folder().string()));
  }

  const std::filesystem::path& folder() const {
    return options_.resume.empty() ? options_.out : options_.resume;
  }

  void Keep(const std::vector<SideFlight>& sides) {
    const KeptFlights kept = KeepFlights(folder(), sides, options_);
    if (kept.exit != kExitGreen) exit_ = exit_ == kExitError ? exit_ : kept.exit;
    Print(stdout, "{} flights on the sides of the margins are in {}\n", kept.count,
          (folder() / "flights").string());
  }

  static bool interrupted() { return *InterruptScope::flag(); }

  void Take(const EnvelopeSearchRow& row) {
    if (row.found->error) ++unknown_count_;
    if (!line_.visible() && !options_.no_progress)
      Tell(fmt::format("{} of {}: {}", search_.done_count(), search_.rows().size(), row.task.job.name));
    Write();
  }

  void OnUnknown(const TrialResult& unknown) {
    if (exit_ != kExitError) exit_ = UnknownExit(unknown);
  }

  void PrintResults() const {
    Print(stdout, "{}", TextLines(EnvelopeTable(search_)));
    for (const EnvelopeMap& map : search_.maps()) Print(stdout, "\n{}", TextLines(EnvelopeMapText(map)));
    PrintNotApplicable();
    for (const EnvelopeFirmware& firmware : search_.firmwares()) PrintUnsurvived(firmware.name);
    if (const std::size_t others = search_.others_count(); others > 0)
      PrintLine(stdout, 0,
                fmt::format("{} rows of an earlier run are not selected now, and stay in the file", others));
  }

  void PrintNotApplicable() const {
    for (const std::string& line : NotApplicableLines(search_)) PrintLine(stdout, 0, line);
  }

  // Prints the reason that rows have no margin: most often the scenario itself fails.
  void PrintUnsurvived(const std::string& client) const {
    if (const auto broken = search_.broken().find(client); broken != search_.broken().end()) {
      PrintLine(stdout, 0,
                fmt::format("{}: fails without any fault, seed {}: {}; so it has no margins", client,
                            broken->second.seed, broken->second.reason));
      return;
    }
    std::size_t count = 0;
    const EnvelopeSearchRow* first = nullptr;
    for (const EnvelopeSearchRow& row : search_.rows()) {
      if (row.client != client || !row.found || row.found->survives || row.found->error) continue;
      ++count;
      if (first == nullptr) first = &row;
    }
    if (first != nullptr)
      PrintLine(stdout, 0,
                fmt::format("{}: {} of its rows fail at the mildest level already, {} the first: {}; does "
                            "`tiltproof run` of the scenario pass?",
                            client, count, first->row.type->name, first->found->reason.value_or("")));
  }

  void Write() const { WriteFile(folder() / "envelope.json", ToJsonText(search_.envelope())); }

  void ShowProgress() {
    if (!line_.visible()) return;
    const std::size_t done = search_.done_count(), all = search_.rows().size();
    const std::size_t earlier = search_.resumed_count();
    std::string text = fmt::format("{} of {} rows, {} flights", done, all, search_.flown_count());
    if (unknown_count_ > 0) text += fmt::format(", {} without a margin", unknown_count_);
    const double passed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    const auto left = TimeLeft(
        static_cast<double>(done - earlier) / static_cast<double>(std::max<std::size_t>(all - earlier, 1)),
        passed_s);
    line_.Show(text + (left ? fmt::format(", {} left", DurationText(*left)) : ""));
  }
  void Tell(const std::string& line) {
    line_.Clear();
    Print(stderr, "{}\n", line);
  }

  const EnvelopeOptions& options_;
  link::OwnedDescriptor lock_;  // of the folder
  EnvelopeSearch search_;
  int exit_ = kExitGreen;
  std::size_t unknown_count_ = 0;  // rows whose flights could not be judged
  ProgressLine line_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

int EnvelopeCommand(const EnvelopeOptions& options) {
  const InterruptScope scope;
  return EnvelopeRun(options, PlanEnvelope(options)).Run();
}

}  // namespace

void RegisterEnvelope(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<EnvelopeOptions>();
  options->command = line.words;
  CLI::App* command = program.add_subcommand(
      "envelope", "Find the margin of every fault that a firmware can take, over one scenario");
  command
      ->add_option("SCENARIO", options->scenario,
                   "A scenario file with a fault of type harness.null: the faults act in its place")
      ->required();
  command
      ->add_option("--types", options->types,
                   "Only fault types that match, for example 'sensor.*,frame.delay'")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--firmware", options->firmware,
                   "Builds of the shipped firmware, side by side, all with one client: paper,tolerant")
      ->delimiter(',')
      ->check(NamesNoBuild)
      ->allow_extra_args(false);
  AddClients(*command, options->clients, "Several stand side by side.");
  command
      ->add_option("--map", options->map,
                   "Also fly pairs of levels of two types, each as TYPE or TYPE:PLACE (frame.drop:both); "
                   "without --types nothing else")
      ->type_name("TYPE1 TYPE2")
      ->expected(2);
  CLI::Option* out =
      command->add_option("--out", options->out, "Where envelope.json goes")->capture_default_str();
  command
      ->add_option("--resume", options->resume,
                   "Go on with the envelope.json in this folder: rows that it has are not flown again")
      ->type_name("DIR")
      ->excludes(out);
  AddSearch(*command, *options);
  command->add_flag("--keep", options->keep,
                    "At the end fly both sides of each margin once more, and keep these flights");
  command->add_flag("--no-report", options->no_report, "Write no envelope.html");
  command->add_flag("--no-progress", options->no_progress, "No progress on standard error");
  SetAction(*command, line, [options] { return EnvelopeCommand(*options); });
}

}  // namespace tiltproof::harness
