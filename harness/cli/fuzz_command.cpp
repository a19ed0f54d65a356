#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "harness/campaign/broken_flight.h"
#include "harness/campaign/fuzz.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/fuzz_files.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/protocol_flag.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/json_text.h"
#include "harness/run/message_binding.h"
#include "harness/scenario/model_path.h"
#include "harness/scenario/reader.h"
#include "harness/terminal/progress_line.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct FuzzOptions {
  std::vector<std::string> clients;
  std::string protocol = "paper";
  std::string model = Scenario().model;
  std::string firmware;                     // build; empty: the usual one
  std::optional<double> time_s;             // none: a minute
  std::optional<std::uint64_t> runs_count;  // inputs; instead of a time
  std::uint64_t seed = 1;
  int jobs_count = 1;
  std::filesystem::path out = "results/fuzz";
  std::string format = "human";
  bool no_progress = false;
};

using FuzzClock = std::chrono::steady_clock;

double SecondsSince(FuzzClock::time_point begin) {
  return std::chrono::duration<double>(FuzzClock::now() - begin).count();
}

FlightMeans FuzzMeans(const FuzzOptions& options) {
  FlightMeans means;
  means.clients = ReadClientFlags(options.clients);
  if (!means.clients.by_id.empty()) throw UsageError("--client: fuzz has one client; leave out its id");
  means.realtime = !AbilitiesOf(means.clients.all, false).virtual_time;
  if (means.realtime && options.jobs_count > 1)
    throw UsageError(fmt::format("-j {}: --client {} flies in real time, one flight at a time",
                                 options.jobs_count, ToText(means.clients.all)));
  return means;
}

LoadedScenario LoadBase(const FuzzOptions& options, const FlightMeans& means) {
  const std::shared_ptr<const link::Protocol> protocol = ReadProtocolFlag(options.protocol);
  const std::string build = options.firmware.empty() ? Scenario().firmware : options.firmware;
  if (AbilitiesOf(means.clients.all, false).shipped) CheckBuild(build);
  if (build.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") != std::string::npos)
    throw UsageError(fmt::format("--firmware {}: must be lower-case letters, digits and '_'", build));
  const VehicleSignals signals = LoadModelFlag(options.model)->signals();
  if (const std::string problem = UnsuitableProtocol(*ForVehicle(protocol, signals), signals);
      !problem.empty())
    throw UsageError(fmt::format("--protocol {}: {} (--model {})", options.protocol, problem, options.model));
  // A finding is a file elsewhere.
  const std::string model = IsModelPath(options.model) ? ResolveModel(options.model).string() : options.model;
  return LoadAnnounced(WriteResolved(FuzzBase(build, protocol, model)));
}

class FuzzRun {
 public:
  FuzzRun(const FuzzOptions& options, const FlightMeans& means, const LoadedScenario& base)
      : options_(options),
        base_(base.scenario),
        files_(options.out, FlagsOf(means)),
        campaign_(
            {.flight = {.name = "fuzz",
                        .scenario = base.scenario,
                        .model = base.model,
                        .means = means,
                        .replay = {}},
             .jobs_count = options.jobs_count,
             .runs_count = options.runs_count,
             .is_over = [this] { return SecondsSince(begin_) >= options_.time_s.value_or(60); },
             .is_small_enough = [this](std::size_t left_count) { return IsSmallEnough(left_count); },
             .seed = options.seed,
             .interrupted = InterruptScope::flag(),
             .tell = [this](const std::string& line) { Tell(line); },
             .on_turn = [this] { ShowProgress(); },
             .on_corpus = [this](const HostileSequence& sequence) { Keep([&] { files_.Add(sequence); }); },
             .on_finding = [this](const FuzzFinding& finding) { Take(finding); },
             .on_mended = [this](const std::string& name) { TellMended(name); }}),
        line_(!options.no_progress),
        client_(ToText(means.clients.all)) {
    WarnOfOthers();
    for (auto& [name, sequence] : files_.ReadFindings()) campaign_.AddFinding(name, std::move(sequence));
    for (HostileSequence& sequence : files_.ReadCorpus()) campaign_.Add(std::move(sequence));
  }

  // The exit code.
  int Run() {
    const auto unusable = campaign_.WhyUnusable();
    if (unusable) {
      line_.Clear();
      Print(stderr, "tiltproof: fuzz: the firmware fails without hostile bytes: {}\n", *unusable);
      return kExitError;
    }
    if (!campaign_.sees_coverage() && !interrupted())
      Tell(
          "this firmware does not tell what it executes, so that the frames are chosen blindly: "
          "docs/fuzzing.md says how to build it");
    begin_ = FuzzClock::now();
    campaign_.Run();
    wall_s_ = SecondsSince(begin_);
    minimises_ = true;
    findings_left_ = campaign_.findings().size();
    minimise_begin_ = finding_begin_ = FuzzClock::now();
    campaign_.MinimiseFindings();
    line_.Clear();
    summary_written_ = Keep([&] { files_.WriteSummary(Summary()); });
    Report();
    if (write_trouble_)
      Print(stderr, "tiltproof: fuzz: not everything could be written: {}\n", *write_trouble_);
    if (interrupted()) return kExitInterrupted;
    if (campaign_.hangs_too_often())
      Print(stderr, "tiltproof: fuzz: ended early: the firmware hung again and again; fix that first\n");
    if (campaign_.trouble()) {
      Print(stderr, "tiltproof: fuzz: ended early: a flight could not be judged: {}\n", *campaign_.trouble());
      return kExitError;
    }
    if (write_trouble_) return kExitError;
    return campaign_.findings().empty() ? kExitGreen : kExitNotGreen;
  }

 private:
  static bool interrupted() { return *InterruptScope::flag(); }
  static std::string FlagsOf(const FlightMeans& means) {
    return ClientFlagsOf(means.clients) + (means.realtime ? " --mode realtime" : "");
  }

  // Once, whichever of the many flights it is about.
  void Tell(const std::string& line) {
    if (!told_.insert(KeyOfReason(line)).second) return;
    line_.Clear();
    Print(stderr, "tiltproof: {}\n", line);
  }

  // With a limit on time, as long as the search lasted, and 10 s at least; each finding has an equal part of what is left.
  // Without one, the same inputs must give the same files.
  bool IsSmallEnough(std::size_t left_count) {
    if (std::exchange(findings_left_, left_count) != left_count) finding_begin_ = FuzzClock::now();
    if (options_.runs_count) return false;
    const double limit_s = std::max(kMinimiseMinS, wall_s_);
    const double begun_s = std::chrono::duration<double>(finding_begin_ - minimise_begin_).count();
    return SecondsSince(finding_begin_) >= (limit_s - begun_s) / static_cast<double>(left_count);
  }

  // A full disk does not end the search: what it finds is printed, too.
  bool Keep(const std::function<void()>& write) {
    try {
      write();
      return true;
    } catch (const std::exception& error) {
      if (!write_trouble_) Tell(error.what());
      if (!write_trouble_) write_trouble_ = error.what();
      return false;
    }
  }

  void TellMended(const std::string& name) {
    line_.Clear();
    Print(stderr, "tiltproof: {} of before breaks nothing now: {}\n", name, files_.FileOf(name).string());
  }

  // Warns of a folder of another firmware: its files may be of use with that one, and are never results of this one.
  void WarnOfOthers() {
    const nlohmann::ordered_json last = files_.ReadSummary();
    const auto of = [&](const char* key) {
      return last.is_object() && last.contains(key) && last[key].is_string() ? last[key].get<std::string>()
                                                                             : "";
    };
    if (last.is_null() || (of("client") == client_ && of("firmware") == base_.firmware &&
                           of("protocol") == base_.link.protocol->name))
      return;
    Tell(
        fmt::format("warning: --out {}: its corpus, and perhaps findings, are of --client {} --firmware {} "
                    "--protocol {}; they are kept",
                    files_.folder().string(), of("client"), of("firmware"), of("protocol")));
  }

  // On the disk at once, so that an interrupt loses nothing; and printed before that, so that a full disk does not, either.
  void Take(const FuzzFinding& finding) {
    if (!minimises_ && options_.format == "human") {
      line_.Clear();
      Print(stdout, "{} after {} input{}: {}\n", finding.broken.Name(), finding.at_runs,
            finding.at_runs == 1 ? "" : "s", finding.broken.reason);
      std::fflush(stdout);
    }
    if (Keep([&] { files_.Write(finding, campaign_.base()); }))
      unwritten_.erase(finding.broken.Name());
    else
      unwritten_.insert(finding.broken.Name());
  }

  nlohmann::ordered_json JsonOf(const FuzzFinding& finding) const {
    std::size_t bytes = 0;
    for (const LineBytes& input : finding.sequence.inputs) bytes += input.size();
    return {{"name", finding.broken.Name()},
            {"kind", finding.broken.kind},
            {"reason", finding.broken.reason},
            {"file", files_.FileOf(finding.broken.Name()).string()},
            {"replay", files_.ReplayOf(finding)},
            {"executions", finding.at_runs},
            {"flights", finding.flights_count},
            {"inputs", finding.sequence.inputs.size()},
            {"bytes", bytes},
            {"minimised", finding.minimised},
            {"confirmed", finding.confirmed}};
  }

  nlohmann::ordered_json Summary() const {
    nlohmann::ordered_json findings = nlohmann::ordered_json::array();
    for (const FuzzFinding& finding : campaign_.findings()) findings.push_back(JsonOf(finding));
    return {{"format", kResultsFormat},
            {"client", client_},
            {"firmware", base_.firmware},
            {"protocol", base_.link.protocol->name},
            {"seed", options_.seed},
            {"complete", !interrupted() && !campaign_.trouble() && !campaign_.hangs_too_often()},
            {"executions", campaign_.runs_count()},
            {"flights", campaign_.flights_count()},
            {"wall_s", wall_s_},
            {"executions_per_s", PerSecond(wall_s_)},
            {"coverage", campaign_.sees_coverage()},
            {"features", campaign_.features_count()},
            {"corpus", campaign_.corpus().size()},
            {"findings", findings}};
  }

  double PerSecond(double wall_s) const {
    return wall_s > 0 ? static_cast<double>(campaign_.runs_count()) / wall_s : 0;
  }

  std::string Numbers(double wall_s) const {
    std::string text = fmt::format("{} executions, {:.0f} per s", campaign_.runs_count(), PerSecond(wall_s));
    if (campaign_.sees_coverage())
      text += fmt::format(", {} features, corpus {}", campaign_.features_count(), campaign_.corpus().size());
    const std::size_t found = campaign_.findings().size();
    return text + fmt::format(", {} finding{}", found, found == 1 ? "" : "s");
  }

  void ShowProgress() {
    if (!line_.visible()) return;
    const double passed_s = SecondsSince(begin_);
    line_.Show(minimises_ ? fmt::format("making finding {} of {} smaller: {} flights, {}",
                                        campaign_.findings().size() - findings_left_ + 1,
                                        campaign_.findings().size(), campaign_.repeats_count(),
                                        DurationText(SecondsSince(minimise_begin_)))
                          : Numbers(passed_s));
  }

  void Report() const {
    for (const FuzzFinding& finding : campaign_.findings()) {
      if (options_.format == "jsonl") {
        Print(stdout, "{}\n", JsonLine(JsonOf(finding)));
        continue;
      }
      Print(stdout, "\n{}: {}\n", finding.broken.Name(), finding.broken.reason);
      Print(stdout, "  {} input{}{}, broke {} flight{}\n  {}\n", finding.sequence.inputs.size(),
            finding.sequence.inputs.size() == 1 ? "" : "s",
            !finding.minimised   ? " (not made as small as it could be)"
            : !finding.confirmed ? " (not seen again: it depends on more than these bytes)"
                                 : "",
            finding.flights_count, finding.flights_count == 1 ? "" : "s",
            unwritten_.contains(finding.broken.Name())
                ? fmt::format("it could not be written to {}", files_.FileOf(finding.broken.Name()).string())
                : files_.ReplayOf(finding));
      if (unwritten_.contains(finding.broken.Name()))
        Print(stdout, "  on {}, {}: {}\n", faults::Name(finding.sequence.target), PlaceText(finding.sequence),
              FramesText(finding.sequence));
    }
    if (options_.format == "jsonl") {
      nlohmann::ordered_json summary = Summary();
      summary.erase("findings");
      Print(stdout, "{}\n", JsonLine(summary));
      return;
    }
    if (!campaign_.findings().empty()) Print(stdout, "\n");
    Print(stdout, "{} in {:.0f} s{}{}\n", Numbers(wall_s_), wall_s_, interrupted() ? " (interrupted)" : "",
          summary_written_ ? "; " + (files_.folder() / "fuzz.json").string() : "");
  }

  const FuzzOptions& options_;
  Scenario base_;
  FuzzFiles files_;
  FuzzCampaign campaign_;
  ProgressLine line_;
  std::string client_;
  FuzzClock::time_point begin_ = FuzzClock::now();
  double wall_s_ = 0;
  bool minimises_ = false, summary_written_ = false;
  static constexpr double kMinimiseMinS = 10;
  FuzzClock::time_point minimise_begin_, finding_begin_;
  std::size_t findings_left_ = 0;
  std::optional<std::string> write_trouble_;  // the first
  std::set<std::string> unwritten_;           // names of findings
  std::set<std::string> told_;                // without their numbers
};

int FuzzCommand(const FuzzOptions& options) {
  const FlightMeans means = FuzzMeans(options);
  const LoadedScenario base = LoadBase(options, means);
  CheckReady(means);
  CheckPorts(means.clients.all, base.scenario);
  const InterruptScope scope;
  return FuzzRun(options, means, base).Run();
}

}  // namespace

void RegisterFuzz(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<FuzzOptions>();
  CLI::App* command = program.add_subcommand(
      "fuzz",
      "Send hostile frames to a firmware, and write each that breaks it as a scenario (1: found some)");
  AddClients(*command, options->clients);
  command
      ->add_option("--protocol", options->protocol,
                   "What the firmware speaks: a built-in protocol or a protocol file")
      ->capture_default_str();
  command
      ->add_option("--model", options->model,
                   "The vehicle whose signals the protocol carries: a model's name, or a path ending in .sdf")
      ->capture_default_str();
  AddFirmware(*command, options->firmware);
  auto* fuzz_time = command->add_option("--time", options->time_s, "How long, in s (default: 60)")
                        ->check(CLI::Range(0.1, 1e7));
  command
      ->add_option("--runs", options->runs_count,
                   "So many inputs instead; the same --seed and corpus then find the same, with any -j")
      ->check(CLI::Range(std::uint64_t{1}, kSeedMax))
      ->excludes(fuzz_time);
  command->add_option("--seed", options->seed, "Of all that is drawn at random")
      ->check(CLI::Range(std::uint64_t{0}, kSeedMax))
      ->capture_default_str();
  AddJobs(*command, options->jobs_count);
  command
      ->add_option("--out", options->out,
                   "Where findings/, corpus/ and fuzz.json go; a corpus that is there is where it begins")
      ->capture_default_str();
  AddFormat(*command, options->format, "human, or jsonl: one JSON object per finding, and one of all");
  command->add_flag("--no-progress", options->no_progress, "No progress line on the terminal");
  command->footer("How to build a firmware for it, and what a finding is: docs/fuzzing.md.");
  SetAction(*command, line, [options] { return FuzzCommand(*options); });
}

}  // namespace tiltproof::harness
