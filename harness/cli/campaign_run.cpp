#include "harness/cli/campaign_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "harness/campaign/campaign_confirm.h"
#include "harness/campaign/campaign_failures.h"
#include "harness/campaign/campaign_flights.h"
#include "harness/campaign/campaign_minimiser.h"
#include "harness/campaign/campaign_signature.h"
#include "harness/cli/applicability.h"
#include "harness/cli/campaign_cluster.h"
#include "harness/cli/campaign_flown.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/cli/console.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/temporary_folder.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/results.h"
#include "harness/score/headline.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/progress_line.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

using CampaignClock = std::chrono::steady_clock;
// One transaction holds so many runs, or those of so long.
constexpr std::size_t kBatchMax = 256;
constexpr std::chrono::seconds kBatchTime{1};
// Differences that are printed.
constexpr std::size_t kDifferencesMax = 20;
// Runs that were not judged, which are named.
constexpr std::size_t kUnjudgedMax = 10;
// Between two lines of progress where there is no terminal, and where there is one.
constexpr std::chrono::milliseconds kPlainTime{10'000}, kLineTime{100};

// The runs of the campaign that are to be flown, and what is known of those that were.
class CampaignProgress {
 public:
  CampaignProgress(const LoadedCampaign& campaign, const CampaignStore& store)
      : first_(campaign.shard.First(static_cast<std::uint64_t>(campaign.plan.spec.runs_count))),
        flown_(campaign.shard.End(static_cast<std::uint64_t>(campaign.plan.spec.runs_count)) - first_) {
    store.ForEach([&](const CampaignRun& run) {
      if (run.number < first_ || run.number - first_ >= flown_.size()) return;
      flown_[run.number - first_] = true;
      Count(run);
    });
    earlier_count_ = done_count_;
  }

  std::optional<std::uint64_t> Next() {
    while (next_ < flown_.size() && flown_[next_]) ++next_;
    if (next_ == flown_.size()) return std::nullopt;
    return first_ + next_++;
  }

  void Count(const CampaignRun& run) {
    ++done_count_;
    if (run.verdict == Name(Verdict::kPass)) ++passed_count_;
    if (run.end == Name(EndReason::kLineOverfull))
      overfull_.push_back(run.number);
    else if (run.verdict == Name(Verdict::kError))
      errors_.push_back(run.number);
    else if (run.verdict == Name(Verdict::kInconclusive))
      inconclusive_.push_back(run.number);
    if (run.signature.empty()) return;
    ++failures_count_;
    signatures_.insert(run.signature);
  }

  std::string Text() const {
    const double passed_s = std::chrono::duration<double>(CampaignClock::now() - begin_).count();
    const auto flown = static_cast<double>(done_count_ - earlier_count_);
    std::string text =
        fmt::format("{} of {} runs, {:.0f} runs/s, {} failure{}, {} signature{}", done_count_, flown_.size(),
                    passed_s > 0 ? flown / passed_s : 0, failures_count_, failures_count_ == 1 ? "" : "s",
                    signatures_.size(), signatures_.size() == 1 ? "" : "s");
    const auto to_fly = static_cast<double>(flown_.size() - earlier_count_);
    if (const auto left = TimeLeft(flown / std::max(to_fly, 1.0), passed_s))
      text += fmt::format(", {} left", DurationText(*left));
    return text;
  }

  std::uint64_t total() const { return flown_.size(); }
  std::uint64_t done_count() const { return done_count_; }
  std::uint64_t passed_count() const { return passed_count_; }
  std::uint64_t failures_count() const { return failures_count_; }
  // Runs that were not judged: their draws put more on a line than it holds, the harness failed, or others.
  const std::vector<std::uint64_t>& overfull() const { return overfull_; }
  const std::vector<std::uint64_t>& errors() const { return errors_; }
  const std::vector<std::uint64_t>& inconclusive() const { return inconclusive_; }
  CampaignClock::time_point begin() const { return begin_; }

 private:
  std::uint64_t first_;
  std::vector<bool> flown_;
  std::uint64_t next_ = 0, done_count_ = 0, earlier_count_ = 0, passed_count_ = 0, failures_count_ = 0;
  std::vector<std::uint64_t> overfull_, errors_, inconclusive_;
  std::set<std::string> signatures_;
  CampaignClock::time_point begin_ = CampaignClock::now();
};

// The client that confirms, if there is one. Throws UsageError.
std::optional<FlightMeans> ConfirmingMeans(const CampaignOptions& options) {
  if (options.confirm.empty()) return {};
  FlightMeans means = LockstepMeans(ReadClientFlags({options.confirm}), "campaign --confirm");
  CheckReady(means);
  return means;
}

// The number in a RunName().
std::uint64_t RunNumber(const std::string& name) { return std::stoull(name.substr(RunName(0).size() - 1)); }

class CampaignWork {
 public:
  CampaignWork(const CampaignOptions& options, std::filesystem::path folder, LoadedCampaign campaign,
               CampaignStore& store, std::optional<FlightMeans> confirm = {})
      : options_(options),
        folder_(std::move(folder)),
        campaign_(std::move(campaign)),
        store_(store),
        progress_(campaign_, store),
        confirm_(std::move(confirm)),
        line_(!options.no_progress) {}

  // The exit code.
  int Run() {
    TellLeftOut();
    if (options_.executor == "slurm" ? !FlyTasks() : !FlyRuns())
      return interrupted() ? Interrupted() : kExitError;
    if (interrupted()) return Interrupted();
    if (const int code = KeepFailures(); code != kExitGreen) return code;
    if (const int code = Confirm(); code != kExitGreen) return code;
    WriteSummary(store_, folder_);
    if (!options_.no_report) WriteCampaignReport(folder_, options_.command.front());
    Report();
    if (!progress_.errors().empty()) return kExitError;
    if (progress_.failures_count() > 0 || differs_) return kExitNotGreen;
    // The draws are to blame for a line that is overfull, and other draws were judged.
    return !progress_.inconclusive().empty() || progress_.passed_count() == 0 ? kExitUndecided : kExitGreen;
  }

  // Only its runs, which are stored. The exit code.
  int RunTask() {
    if (!FlyRuns()) return kExitError;
    return interrupted() ? kExitInterrupted : kExitGreen;
  }

 private:
  static bool interrupted() { return *InterruptScope::flag(); }

  void Tell(const std::string& text) {
    line_.Clear();
    PrintLine(stderr, 0, "tiltproof: " + text);
  }

  void TellLeftOut() {
    std::vector<std::string> types;
    for (const auto& [type, reason] : campaign_.left_out) types.push_back(type);
    if (!types.empty())
      Tell(fmt::format("not drawn, because this client, vehicle or protocol cannot have them: {}",
                       fmt::join(types, ", ")));
  }

  std::string HowToGoOn() const {
    return fmt::format("go on with `{} campaign --resume {}{}`", options_.command.front(), folder_.string(),
                       options_.executor == "local" ? "" : " --executor " + options_.executor);
  }

  // False: the results could not be stored, and that was said.
  bool FlyRuns() {
    CampaignFlights flights(campaign_.plan, campaign_.means,
                            {.jobs_count = options_.jobs_count,
                             .interrupted = InterruptScope::flag(),
                             .tell = [this](const std::string& text) { Tell(text); },
                             .on_turn = [this] { Poll(); }},
                            [this](CampaignRun run) { return Take(std::move(run)); });
    try {
      if (!HasEnough()) flights.Fly([this] { return progress_.Next(); });
      Flush();
    } catch (const FileError& error) {
      Tell(fmt::format("campaign: {}; what was stored before is kept. Make room, and {}", error.what(),
                       HowToGoOn()));
      return false;
    }
    line_.Clear();
    return true;
  }

  // As FlyRuns().
  bool FlyTasks() {
    bool good = false;
    try {
      good =
          FlyOnCluster(store_, {.folder = folder_,
                                .options = options_,
                                .name = campaign_.plan.spec.name,
                                .tell = [this](const std::string& text) { Tell(text); },
                                .on_turn = [this](const std::string& text) { Show([&] { return text; }); }});
    } catch (const FileError& error) {
      Tell(fmt::format("campaign: {}; {}", error.what(), HowToGoOn()));
    }
    line_.Clear();
    progress_ = CampaignProgress(campaign_, store_);
    return good;
  }

  bool Take(CampaignRun run) {
    run.signature = FirstSignature(run);
    progress_.Count(run);
    batch_.push_back(std::move(run));
    return !HasEnough();
  }

  bool HasEnough() const {
    const StopSpec& stop = campaign_.plan.spec.stop;
    if (stop.failures_count > 0 &&
        progress_.failures_count() >= static_cast<std::uint64_t>(stop.failures_count))
      return true;
    return stop.wall_s &&
           CampaignClock::now() - progress_.begin() >= std::chrono::duration<double>(*stop.wall_s);
  }

  void Poll() {
    const auto now = CampaignClock::now();
    if (batch_.size() >= kBatchMax || now - stored_at_ >= kBatchTime) Flush();
    Show([this] { return progress_.Text(); });
  }

  // Flights may take less time than the line.
  void Show(const std::function<std::string()>& text) {
    const auto now = CampaignClock::now();
    if (options_.no_progress || now - told_at_ < (line_.visible() ? kLineTime : kPlainTime)) return;
    told_at_ = now;
    line_.visible() ? line_.Show(text()) : Print(stderr, "{}\n", text());
  }

  void Flush() {
    if (!batch_.empty()) store_.Add(batch_);
    batch_.clear();
    stored_at_ = CampaignClock::now();
  }

  int Interrupted() {
    Tell(fmt::format("interrupted after {} of {} runs; {}", progress_.done_count(), progress_.total(),
                     HowToGoOn()));
    return kExitInterrupted;
  }

  void Minimise() {
    std::vector<std::uint64_t> runs;
    MinimisedChooser chooser;
    store_.ForEach([&](const CampaignRun& run) {
      if (!run.signature.empty() && chooser.Choose(run.signature)) runs.push_back(run.number);
    });
    std::optional<CampaignMinimiser> minimiser;
    minimiser.emplace(campaign_.plan, campaign_.means, runs,
                      FlightsOptions{.jobs_count = options_.jobs_count,
                                     .interrupted = InterruptScope::flag(),
                                     .tell = [this](const std::string& text) { Tell(text); },
                                     .on_turn =
                                         [&] {
                                           Show([&] {
                                             return fmt::format(
                                                 "making failures smaller: {} of {}, {} flights",
                                                 minimiser->found_count(), runs.size(),
                                                 minimiser->flights_count());
                                           });
                                         }});
    MinimiseFailures(store_, folder_, [&](std::uint64_t run) { return minimiser->Find(run); });
    line_.Clear();
  }

  // Finds the smallest form of the failures, and flies the first of each signature once more, for its files.
  int KeepFailures() {
    Minimise();
    if (interrupted()) return Interrupted();
    std::vector<FlightToKeep> flights;
    for (const CampaignFailure& failure : KeptFailures(store_.Failures())) {
      const std::filesystem::path folder = folder_ / "failures" / failure.signature;
      if (IsKept(folder, failure.run)) continue;
      FlightJob job = JobOf(campaign_.plan, campaign_.means, DrawRun(campaign_.plan, failure.run));
      job.name = RunName(failure.run);
      flights.push_back({folder, std::move(job)});
    }
    const KeptRuns flown = KeepRuns(std::move(flights), options_);
    if (flown.interrupted) return Interrupted();
    for (const FlightResult& result : flown.results) {
      const std::uint64_t number = RunNumber(result.name);
      const std::string stored = store_.Find(number)->trace_hash;
      if (result.trace_hash == stored) continue;
      if (result.score.verdict == Verdict::kError) {
        Tell(fmt::format("campaign: run {} could not be flown again: {}; {}", number, result.score.reason,
                         HowToGoOn()));
        return kExitError;
      }
      Tell(fmt::format("campaign: run {} flown again is another flight: its trace hash is {}, and was {}",
                       number, result.trace_hash, stored));
      return kExitError;
    }
    return kExitGreen;
  }

  // True if the run's flight is there with all that belongs to it: an earlier command may have been interrupted.
  bool IsKept(const std::filesystem::path& folder, std::uint64_t run) const {
    const std::filesystem::path flight = folder / RunName(run);
    if (!HasEnded(flight) || (!options_.no_report && !std::filesystem::exists(folder / "report.html")))
      return false;
    try {
      const FlightResult kept = ReadVerdict(flight);
      return kept.score.verdict == Verdict::kFail && kept.trace_hash == store_.Find(run)->trace_hash;
    } catch (const FileError&) {
      return false;
    }
  }

  // Flies what is to be confirmed with the other client, once. The exit code.
  int Confirm() {
    if (!confirm_) return kExitGreen;
    const std::string client = ToText(confirm_->clients.all);
    std::set<std::uint64_t> known;
    for (const CampaignConfirmation& found : store_.Confirmations())
      if (found.client == client) known.insert(found.run);
    std::vector<FlightJob> jobs;
    std::map<std::string, std::uint64_t> impossible;  // by reason
    for (const std::uint64_t run : RunsToConfirm(store_)) {
      if (known.contains(run)) continue;
      FlightJob job = JobOf(campaign_.plan, *confirm_, DrawRun(campaign_.plan, run));
      job.name = RunName(run);
      Suite suite;
      SuiteScenario& flown = suite.scenarios.emplace_back();
      flown.scenario = job.scenario;
      flown.model = job.model;
      const std::vector<NotApplicable> reasons = RemoveNotApplicable(*confirm_, false, suite);
      if (reasons.empty())
        jobs.push_back(std::move(job));
      else
        ++impossible[reasons.front().why];
    }
    for (const auto& [why, count] : impossible)
      Tell(fmt::format("campaign: --confirm: {} run{} cannot be flown by {}: {}", count,
                       count == 1 ? "" : "s", client, why));
    bool is_error = false;
    const FlownFlights flown =
        RunFlights(std::move(jobs), {.jobs_count = options_.jobs_count,
                                     .progress = !options_.no_progress,
                                     .on_finished = [&](const FlightJob& job, const FlightResult& result) {
                                       if (result.end_reason == EndReason::kInterrupted) return;
                                       is_error |= !KeepConfirmation(client, job, result);
                                     }});
    if (flown.interrupted) return Interrupted();
    return is_error ? kExitError : kExitGreen;
  }

  // False: the flight is an error, which is flown again another time.
  bool KeepConfirmation(const std::string& client, const FlightJob& job, const FlightResult& result) {
    const std::uint64_t number = RunNumber(job.name);
    const CampaignRun row = RowOf(number, job.scenario, {}, result);
    if (result.score.verdict == Verdict::kError) {
      Tell(fmt::format("campaign: --confirm: {} is an error: {}", job.name, result.score.reason));
      return false;
    }
    const CampaignConfirmation found = {.run = number,
                                        .client = client,
                                        .verdict = row.verdict,
                                        .end = row.end,
                                        .criterion = row.criterion,
                                        .time_s = row.time_s,
                                        .margin = row.margin,
                                        .trace_hash = row.trace_hash};
    store_.PutConfirmations({&found, 1});
    return true;
  }

  void ReportConfirmed() {
    for (const CampaignConfirmed& confirmed : ConfirmedOf(store_)) {
      differs_ |= confirmed.differ > 0;
      Print(stdout, "confirmed by {}: {} of {} flights have the same verdict and criterion\n",
            confirmed.client, confirmed.same, confirmed.flights);
      const std::vector<std::string> lines = DifferenceLines(confirmed);
      for (std::size_t i = 0; i < std::min(lines.size(), kDifferencesMax); ++i)
        PrintLine(stdout, 2, lines[i]);
      if (lines.size() > kDifferencesMax)
        Print(stdout, "  and {} more: {}\n", lines.size() - kDifferencesMax,
              (folder_ / "campaign.json").string());
    }
  }

  void TellUnjudged(const char* why, const std::vector<std::uint64_t>& runs) {
    if (runs.empty()) return;
    const std::size_t shown_count = std::min(runs.size(), kUnjudgedMax);
    const std::string more =
        shown_count < runs.size() ? fmt::format(" and {} more", runs.size() - shown_count) : "";
    Tell(fmt::format("not judged, because {}: run {}{}", why,
                     fmt::join(runs.begin(), runs.begin() + static_cast<std::ptrdiff_t>(shown_count), ", "),
                     more));
  }

  void Report() {
    const std::uint64_t done = progress_.done_count(), failed = progress_.failures_count(),
                        passed = progress_.passed_count(), judged = passed + failed;
    TellUnjudged("drawn faults overfill a line", progress_.overfull());
    TellUnjudged("the flight is inconclusive", progress_.inconclusive());
    TellUnjudged("the flight is an error", progress_.errors());
    std::set<std::string> ways;
    for (const CampaignFailure& failure : store_.Failures()) ways.insert(failure.signature);
    Print(stdout, "campaign {}: {} run{}, {} survived ({:.1f} %), {} failed in {} way{}{}; {}\n",
          campaign_.plan.spec.name, done, done == 1 ? "" : "s", passed,
          judged > 0 ? 100.0 * static_cast<double>(passed) / static_cast<double>(judged) : 0, failed,
          ways.size(), ways.size() == 1 ? "" : "s",
          judged < done ? fmt::format(", {} not judged", done - judged) : "", DatabaseOf(folder_).string());
    ReportConfirmed();
  }

  const CampaignOptions& options_;
  std::filesystem::path folder_;
  LoadedCampaign campaign_;
  CampaignStore& store_;
  CampaignProgress progress_;
  std::optional<FlightMeans> confirm_;
  bool differs_ = false;  // a flight of the client that confirms
  ProgressLine line_;
  std::vector<CampaignRun> batch_;
  // On a terminal the first state is shown at once, because all flights may take less time than the line.
  CampaignClock::time_point stored_at_ = CampaignClock::now(), told_at_ = stored_at_ - kLineTime;
};

// Every scenario passes without drawn faults: otherwise the campaign would find that it does not. Returns an exit code
// when one does not. Leaves out the faults on computing where these flights have none.
std::optional<int> CheckBases(const CampaignOptions& options, LoadedCampaign& campaign) {
  std::vector<FlightJob> jobs;
  std::vector<std::string> builds = campaign.plan.spec.firmware;
  if (builds.empty()) builds.emplace_back();
  for (const DrawBase& base : campaign.plan.bases) {
    for (const std::string& build : builds) {
      FlightJob& job =
          jobs.emplace_back(FlightJob{.name = base.scenario.name + (build.empty() ? "" : " of " + build),
                                      .scenario = base.scenario,
                                      .model = base.model,
                                      .means = campaign.means,
                                      .replay = {}});
      if (!build.empty()) job.scenario.FlyFirmware(build);
    }
  }
  const FlownFlights flown =
      RunFlights(jobs, {.jobs_count = options.jobs_count, .progress = !options.no_progress});
  if (flown.interrupted) return kExitInterrupted;
  std::optional<int> code;
  for (const FlightResult& result : flown.results) {
    if (Survived(result.score)) continue;
    PrintLine(stderr, 0,
              fmt::format(
                  "tiltproof: campaign: {}: {} without any drawn fault: {}; a campaign needs scenarios that "
                  "pass by themselves",
                  result.name, Name(result.score.verdict), result.score.reason));
    code = result.score.verdict == Verdict::kError ? kExitError : kExitNotGreen;
  }
  if (code) return code;
  const auto of_base = static_cast<std::ptrdiff_t>(builds.size());
  for (std::size_t base = 0; base < campaign.plan.bases.size(); ++base) {
    const auto first = flown.results.begin() + static_cast<std::ptrdiff_t>(base) * of_base;
    if (std::none_of(first, first + of_base,
                     [](const FlightResult& result) { return StatesComputing(result.score); }))
      LeaveOutComputing(campaign, base);
  }
  return std::nullopt;
}

// Throws UsageError when another program would fly on.
void CheckSameBuild(const LoadedCampaign& campaign, const std::filesystem::path& folder) {
  const std::string build = BuildOf(campaign.means.clients);
  const auto began = campaign.meta.find("build");
  if (began == campaign.meta.end() || began->second == build) return;
  throw UsageError(
      fmt::format("{}: the campaign was begun by another build of tiltproof or of the firmware "
                  "({}; this one is {}): its runs would not be comparable. Begin another campaign with "
                  "--out",
                  folder.string(), began->second, build));
}

// Throws UsageError for what a cluster cannot do.
void CheckExecutor(const CampaignOptions& options, const LoadedCampaign& campaign) {
  if (options.executor == "local") {
    if (options.task_runs) throw UsageError("--task-runs: only with --executor slurm");
    return;
  }
  const StopSpec& stop = campaign.plan.spec.stop;
  if (stop.failures_count > 0 || stop.wall_s)
    throw UsageError(
        "--executor slurm: the campaign's `stop` cannot hold for tasks that do not know of each other: leave "
        "it out, or fly with --executor local");
  if (campaign.shard.count > 1)
    throw UsageError("--executor slurm: flies whole campaigns: leave out --shard, whose work its tasks do");
}

// A database without runs. Where the disk has no room for it, nothing is left of it.
void CreateStore(const std::filesystem::path& file, const std::map<std::string, std::string>& meta) {
  try {
    CampaignStore store(file, CampaignStore::Mode::kCreate);
    for (const auto& [key, value] : meta) store.SetMeta(key, value);
  } catch (const FileError&) {
    for (const char* end : {"", "-wal", "-shm"}) {
      std::error_code error;
      std::filesystem::remove(file.string() + end, error);
    }
    throw;
  }
}

CampaignStore OpenToRead(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(DatabaseOf(folder)))
    throw UsageError(
        fmt::format("{}: there is no campaign in this folder (no campaign.sqlite)", folder.string()));
  return CampaignStore(DatabaseOf(folder), CampaignStore::Mode::kRead);
}

}  // namespace

int FlyCampaign(const CampaignOptions& options) {
  const InterruptScope scope;
  std::optional<FlightMeans> confirm = ConfirmingMeans(options);
  if (!options.resume.empty()) {
    if (!std::filesystem::exists(DatabaseOf(options.resume)))
      throw UsageError(fmt::format("--resume {}: there is no campaign in this folder (no campaign.sqlite)",
                                   options.resume.string()));
    CampaignStore store(DatabaseOf(options.resume), CampaignStore::Mode::kOpen);
    LoadedCampaign campaign = ReopenCampaign(store.AllMeta());
    CheckSameBuild(campaign, options.resume);
    CheckExecutor(options, campaign);
    // Runs that tasks on a cluster have delivered since.
    GatherTasks(store, options.resume);
    return CampaignWork(options, options.resume, std::move(campaign), store, std::move(confirm)).Run();
  }
  if (std::filesystem::exists(DatabaseOf(options.out)))
    throw UsageError(
        fmt::format("{} holds a campaign already: go on with it (--resume {}), or choose another --out",
                    options.out.string(), options.out.string()));
  if (std::filesystem::exists(options.out / "failures"))
    throw UsageError(fmt::format(
        "{} holds the failures of a campaign whose database is gone: remove the folder, or choose "
        "another --out",
        (options.out / "failures").string()));
  LoadedCampaign campaign = PlanCampaign(options);
  CheckExecutor(options, campaign);
  if (const auto code = CheckBases(options, campaign)) return *code;
  std::filesystem::create_directories(options.out);
  CreateStore(DatabaseOf(options.out), campaign.meta);
  CampaignStore store(DatabaseOf(options.out), CampaignStore::Mode::kOpen);
  return CampaignWork(options, options.out, std::move(campaign), store, std::move(confirm)).Run();
}

int FlyCampaignTask(const CampaignOptions& options, std::uint64_t number) {
  const InterruptScope scope;
  const CampaignTasks tasks = ReadTasks(options.resume);
  const Shard task{number, tasks.count};
  if (number < 1 || number > tasks.count)
    throw UsageError(
        fmt::format("campaign task: there is no task {}: the {} tasks count from 1", number, tasks.count));
  if (std::filesystem::exists(ResultOf(options.resume, task))) {
    Print(stdout, "task {} of {} was flown already\n", number, tasks.count);
    return kExitGreen;
  }
  LoadedCampaign campaign = ReopenCampaign(tasks.meta);
  CheckSameBuild(campaign, options.resume);
  campaign.shard = task;
  const TemporaryFolder folder("task");
  {
    CreateStore(DatabaseOf(folder.path()), tasks.meta);
    CampaignStore store(DatabaseOf(folder.path()), CampaignStore::Mode::kOpen);
    if (const int code = CampaignWork(options, folder.path(), std::move(campaign), store).RunTask();
        code != kExitGreen)
      return code;
  }
  DeliverTask(DatabaseOf(folder.path()), options.resume, task);
  Print(stdout, "task {} of {} was flown\n", number, tasks.count);
  return kExitGreen;
}

int ShowCampaignRun(const CampaignOptions& options, std::uint64_t number) {
  const InterruptScope scope;
  const std::filesystem::path& folder = options.resume;
  const CampaignStore store = OpenToRead(folder);
  const LoadedCampaign campaign = ReopenCampaign(store.AllMeta());
  const auto runs_count = static_cast<std::uint64_t>(campaign.plan.spec.runs_count);
  if (number >= runs_count)
    throw UsageError(
        fmt::format("campaign show: there is no run {}: the {} runs count from 0", number, runs_count));
  const DrawnRun drawn = DrawRun(campaign.plan, number);
  const std::filesystem::path own = folder / "runs" / std::to_string(number);
  for (const CampaignFault& fault : drawn.faults)
    Print(stdout, "{}: {}{}{} severity {:g}, {:g} to {:g} s\n", fault.id, fault.type,
          fault.place.empty() ? "" : " ", fault.place, fault.severity, fault.start_s, fault.end_s);
  FlightJob job = JobOf(campaign.plan, campaign.means, drawn);
  job.name = RunName(number);
  const KeptRuns flown = KeepRuns({{own, std::move(job)}}, options);
  if (flown.interrupted || flown.results.empty()) return kExitInterrupted;
  const FlightResult& result = flown.results.front();
  const Console console(false);
  console.Finished(result);
  if (result.score.verdict != Verdict::kPass && Survived(result.score))
    console.Line("its faults were too mild to act: the campaign counts it as survived");
  console.Line(fmt::format("{}", (own / "report.html").string()));
  const int code = Survived(result.score) ? static_cast<int>(kExitGreen) : ExitCode({result});
  const std::optional<CampaignRun> stored = store.Find(number);
  if (!stored) {
    console.Line("this run is not in the database: it was not flown yet");
    return code;
  }
  if (stored->trace_hash == result.trace_hash) {
    console.Line(fmt::format("the same flight as in the database: trace hash {}", result.trace_hash));
    return code;
  }
  const std::string build = BuildOf(campaign.means.clients);
  const auto began = campaign.meta.find("build");
  PrintLine(
      stderr, 0,
      fmt::format("tiltproof: campaign show: this is another flight: its trace hash is {}, and was {}{}",
                  result.trace_hash, stored->trace_hash,
                  began != campaign.meta.end() && began->second != build
                      ? "; the campaign was flown by another build of tiltproof or of the firmware"
                      : ""));
  return kExitError;
}

int CampaignStatus(const std::filesystem::path& folder) {
  const CampaignStore store = OpenToRead(folder);
  const auto meta = store.AllMeta();
  const auto text = [&](const char* key) { return meta.contains(key) ? meta.at(key) : std::string("?"); };
  const CampaignSpec spec = ParseCampaign(text("campaign"), "campaign.sqlite: campaign");
  const Shard shard = ReadShard(text("shard"));
  const auto all = static_cast<std::uint64_t>(spec.runs_count);
  const std::uint64_t total = shard.End(all) - shard.First(all);
  std::uint64_t done = 0, failed = 0, passed = 0;
  std::set<std::string> signatures;
  store.ForEach([&](const CampaignRun& run) {
    ++done;
    passed += run.verdict == Name(Verdict::kPass) ? 1 : 0;
    if (run.signature.empty()) return;
    ++failed;
    signatures.insert(run.signature);
  });
  // The final ones, when they are known.
  const bool is_gathered = std::filesystem::exists(folder / "campaign.json");
  if (is_gathered) {
    signatures.clear();
    for (const CampaignFailure& failure : store.Failures()) signatures.insert(failure.signature);
  }
  Print(stdout, "campaign {}: {} of {} runs{}, {} failed in {} way{}{}\n", spec.name, done, total,
        shard.count > 1 ? fmt::format(" of shard {}", text("shard")) : "", failed, signatures.size(),
        signatures.size() == 1 ? "" : "s",
        passed + failed < done ? fmt::format(", {} not judged", done - passed - failed) : "");
  if (const auto tasks = TasksText(store, folder)) Print(stdout, "{}\n", *tasks);
  const bool is_stopped =
      spec.stop.failures_count > 0 && failed >= static_cast<std::uint64_t>(spec.stop.failures_count);
  if (is_stopped && is_gathered)
    Print(stdout, "it was ended by its `stop`\n");
  else if (done < total || !is_gathered)
    Print(stdout, "{}, unless it is flown now: tiltproof campaign --resume {}\n",
          done < total && !is_stopped ? "it can go on" : "its failures are not gathered yet; it can go on",
          folder.string());
  return kExitGreen;
}

}  // namespace tiltproof::harness
