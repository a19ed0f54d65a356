#include <fcntl.h>
#include <fmt/format.h>
#include <fnmatch.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "faults/registry.h"
#include "harness/campaign/envelope_rows.h"
#include "harness/campaign/margins.h"
#include "harness/cli/applicability.h"
#include "harness/cli/commands.h"
#include "harness/cli/envelope_columns.h"
#include "harness/cli/envelope_flights.h"
#include "harness/cli/envelope_report.h"
#include "harness/cli/envelope_resume.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/report_command.h"
#include "harness/cli/search_flights.h"
#include "harness/report/files.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/fault_support.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/progress_line.h"
#include "harness/terminal/terminal.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

bool IsOneOf(const std::string& pattern, std::string_view type) {
  return fnmatch(pattern.c_str(), std::string(type).c_str(), 0) == 0;
}

// "frame.delay" or "frame.delay:to_client".
EnvelopeRow MapRow(const std::string& text, const VehicleSignals& signals) {
  const std::size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const faults::FaultType* type = faults::FindFaultType(name);
  std::vector<std::string_view> names;
  for (const auto& known : faults::FaultTypes()) names.push_back(known.name);
  if (type == nullptr)
    throw UsageError(fmt::format("--map {}: unknown fault type{}", text, DidYouMean(name, names)));
  const std::vector<EnvelopeRow> rows = EnvelopeRows(*type, signals);
  if (colon == std::string::npos) return rows.front();
  std::vector<std::string_view> places;
  for (const EnvelopeRow& row : rows) {
    if (row.place == text.substr(colon + 1)) return row;
    places.push_back(row.place);
  }
  throw UsageError(fmt::format("--map {}: the envelope has no such place{}", text,
                               DidYouMean(text.substr(colon + 1), places)));
}

// Those of the patterns, then those of the map that are not among them.
std::vector<EnvelopeRow> RowsOf(const EnvelopeOptions& options, const VehicleSignals& signals) {
  std::vector<EnvelopeRow> rows;
  for (const std::string& pattern : options.types) {
    const auto matches = [&](const auto& type) { return IsOneOf(pattern, type.name); };
    if (std::none_of(faults::FaultTypes().begin(), faults::FaultTypes().end(), matches))
      throw UsageError(
          fmt::format("--types {}: matches no fault type; `tiltproof faults` prints them all", pattern));
  }
  for (const faults::FaultType& type : faults::FaultTypes()) {
    const bool wanted =
        options.types.empty()
            ? options.map.empty()
            : std::any_of(options.types.begin(), options.types.end(),
                          [&](const std::string& pattern) { return IsOneOf(pattern, type.name); });
    if (!wanted) continue;
    const std::vector<EnvelopeRow> of_type = EnvelopeRows(type, signals);
    rows.insert(rows.end(), of_type.begin(), of_type.end());
  }
  for (const std::string& text : options.map) {
    const EnvelopeRow row = MapRow(text, signals);
    const auto same = [&](const EnvelopeRow& other) { return other.IsAt(row); };
    if (std::none_of(rows.begin(), rows.end(), same)) rows.push_back(row);
  }
  return rows;
}

std::string RowName(const EnvelopeRow& row) {
  return fmt::format("{}{}{}{}{}", row.type->name, row.place.empty() ? "" : " ", row.place,
                     row.side.empty() ? "" : " ", row.side);
}

// Sorts a column's rows into those that its firmware can take, as tasks, and the others.
void AddColumn(const FirmwareColumn& column, const std::vector<EnvelopeRow>& rows, Envelope& envelope,
               std::vector<MarginTask>& tasks) {
  const VehicleSignals& signals = column.base.model->signals();
  const std::size_t place = *FindPlaceholder(column.base.scenario);
  const ClientAbilities abilities =
      AbilitiesOf(column.means.ClientsOf(column.base.scenario).front(), column.means.realtime);
  const auto leave_out = [&](const EnvelopeRow& row, const std::string& reason) {
    envelope.not_applicable.push_back(
        {std::string(row.type->name), row.place + row.side, column.name, reason});
  };
  Suite suite;
  std::map<std::string, std::string> reasons;
  for (const EnvelopeRow& row : rows) {
    SuiteScenario entry = column.base;
    entry.scenario = WithRow(column.base.scenario, row, signals);
    entry.scenario.name = RowName(row);
    entry.named = false;
    if (auto why = Unsupported(entry.scenario.faults[place], *row.type, abilities))
      reasons[RowName(row)] = std::move(*why);
    else
      suite.scenarios.push_back(std::move(entry));
  }
  for (const NotApplicable& other : TakeNotApplicable(column.means, false, suite))
    reasons[other.name] = other.reason;
  for (const EnvelopeRow& row : rows) {
    if (const auto reason = reasons.find(RowName(row)); reason != reasons.end()) {
      leave_out(row, reason->second);
      continue;
    }
    // All of it would be survived.
    if (const auto* plant = row.type->As<faults::PlantKind>();
        plant != nullptr && plant->is_wind && !signals.feels_wind) {
      leave_out(row, "moves only a vehicle with drag; this one's file has no <tiltproof:drag>");
      continue;
    }
    MarginTask task;
    task.job = FlightJob{.name = fmt::format("{} of {}", RowName(row), column.name),
                         .scenario = WithRow(column.base.scenario, row, signals),
                         .model = column.base.model,
                         .means = column.means,
                         .replay = {}};
    task.fault = *FindPlaceholder(column.base.scenario);
    try {
      task.severity = SeverityOf(task.job.scenario, task.fault, signals);
      CheckLevels(task);
    } catch (const SeverityMistake& mistake) {
      leave_out(row, mistake.what());
      continue;
    }
    envelope.entries.push_back({row, column.name, task.severity, std::nullopt});
    tasks.push_back(std::move(task));
  }
}

constexpr int kMapLevelsCount = 12;

// From a tenth of a fault's own margin to 1.2 times it.
std::vector<double> MapLevels(const EnvelopeEntry& entry) {
  const LevelRange& range = entry.severity.range;
  const double last = entry.margin->fails.value_or(range.end);
  const double origin = range.harmless.value_or(range.start);
  const double least = std::min(range.start, range.end), most = std::max(range.start, range.end);
  std::vector<double> levels;
  for (int k = 1; k <= kMapLevelsCount; ++k) {
    const bool towards_zero = range.scale == faults::Scale::kLogarithmic && range.end == 0;
    double level = towards_zero ? last * std::pow(1.25, 10 - k) : origin + (last - origin) * k / 10;
    level = range.whole ? std::round(level) : std::strtod(fmt::format("{:.4g}", level).c_str(), nullptr);
    level = std::clamp(level, least, most);
    if (levels.empty() || levels.back() != level) levels.push_back(level);
  }
  return levels;
}

class EnvelopeSearch {
 public:
  EnvelopeSearch(const EnvelopeOptions& options, std::vector<FirmwareColumn> columns)
      : options_(options),
        columns_(std::move(columns)),
        trials_({.jobs_count = options.jobs_count,
                 .seeds_count = options.repeat_count,
                 .interrupted = InterruptScope::flag(),
                 .tell = [this](const std::string& line) { Tell("tiltproof: " + line); },
                 .on_turn = [this] { ShowProgress(); }}),
        line_(!options.no_progress) {
    const Scenario& base = columns_.front().base.scenario;
    envelope_.scenario = base.name;
    envelope_.seed = base.seed;
    envelope_.repeat_count = options.repeat_count;
    envelope_.tolerance = options.tolerance;
    envelope_.has_map = !options.map.empty();
    for (const FirmwareColumn& column : columns_) {
      envelope_.columns.push_back(IdentityOf(column));
      AddColumn(column, RowsOf(options, column.base.model->signals()), envelope_, tasks_);
    }
    all_tasks_ = tasks_;
    if (!options.resume.empty()) TakeEarlierRows(options.resume / "envelope.json", envelope_);
    LeaveOutDone();
  }

  // The exit code.
  int Run() {
    if (envelope_.entries.empty()) {
      PrintNotApplicable();
      Print(stderr, "tiltproof: nothing is left to fly with this client\n");
      return kExitUndecided;
    }
    TakeFolder();
    Write();
    FlyWithoutFaults();
    FindMargins(trials_, tasks_,
                {.tolerance = options_.tolerance,
                 .at_once_count = 4 * static_cast<std::size_t>(options_.jobs_count) + 4,
                 .on_done = [this](std::size_t task, const Margin& margin) { Take(task, margin); }});
    if (!options_.map.empty() && !interrupted()) FlyMaps();
    line_.Clear();
    envelope_.complete = !interrupted();
    Write();
    Print(stdout, "{}", TextLines(EnvelopeTable(envelope_)));
    for (const EnvelopeMap& map : envelope_.maps) Print(stdout, "\n{}", TextLines(EnvelopeMapText(map)));
    PrintNotApplicable();
    PrintUnsurvived();
    if (const std::size_t others = envelope_.earlier.rows.size(); others > 0)
      PrintLine(stdout, 0,
                fmt::format("{} rows of an earlier run are not selected now, and stay in the file", others));
    const std::vector<SideFlight> sides = SidesOf(envelope_, all_tasks_);
    WriteLevels(folder(), sides);
    if (options_.keep && !interrupted()) Keep(sides);
    if (!options_.no_report)
      if (const auto page = WriteEnvelopeReport(folder(), options_.command.front()))
        PrintLine(stdout, 0, "report: " + page->string());
    Print(stdout, "{} of {} rows, {} flight{}, in {}{}\n", done_count_, envelope_.entries.size(),
          trials_.flown_count(), trials_.flown_count() == 1 ? "" : "s", (folder() / "envelope.json").string(),
          interrupted() ? " (interrupted)" : "");
    return interrupted() ? static_cast<int>(kExitInterrupted) : exit_;
  }

 private:
  // For this process alone, and not over another envelope.
  void TakeFolder() {
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

  // Leaves out the margins that an earlier run has found.
  void LeaveOutDone() {
    std::vector<MarginTask> left;
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      if (envelope_.entries[i].margin) {
        ++done_count_;
        continue;
      }
      left.push_back(std::move(tasks_[i]));
      entries_.push_back(i);
    }
    tasks_ = std::move(left);
    earlier_count_ = done_count_;
  }

  void Keep(const std::vector<SideFlight>& sides) {
    const KeptFlights kept = KeepFlights(folder(), sides, options_);
    if (kept.exit != kExitGreen) exit_ = exit_ == kExitError ? exit_ : kept.exit;
    Print(stdout, "{} flights on the sides of the margins are in {}\n", kept.count,
          (folder() / "flights").string());
  }

  static bool interrupted() { return *InterruptScope::flag(); }

  void Take(std::size_t task, const Margin& margin) {
    envelope_.entries[entries_[task]].margin = margin;
    ++done_count_;
    if (margin.unknown) {
      ++unknown_count_;
      exit_ = exit_ == kExitError ? exit_ : UnknownExit(*margin.unknown);
      Tell("tiltproof: envelope: no margin: " + WhyUnknown(*margin.unknown));
    }
    if (!line_.visible() && !options_.no_progress)
      Tell(fmt::format("{} of {}: {}", done_count_, envelope_.entries.size(), tasks_[task].job.name));
    Write();
  }

  // A firmware that fails without any fault survives no level of any: its rows need no flights.
  void FlyWithoutFaults() {
    for (const FirmwareColumn& column : columns_) {
      if (std::none_of(entries_.begin(), entries_.end(),
                       [&](std::size_t entry) { return envelope_.entries[entry].client == column.name; }))
        continue;
      FlightJob job{.name = fmt::format("no fault, of {}", column.name),
                    .scenario = column.base.scenario,
                    .model = column.base.model,
                    .means = column.means,
                    .replay = {}};
      trials_.Start(job, [this, name = column.name](const TrialResult& result) {
        if (result.answer == TrialResult::Answer::kFailed) broken_.emplace(name, result);
      });
    }
    trials_.Fly();
    std::vector<MarginTask> left;
    std::vector<std::size_t> entries;
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      EnvelopeEntry& entry = envelope_.entries[entries_[i]];
      if (const auto broken = broken_.find(entry.client); broken != broken_.end()) {
        entry.margin.emplace();
        entry.margin->fails = entry.severity.range.start;
        entry.margin->at_fails = broken->second;
        ++done_count_;
      } else {
        left.push_back(std::move(tasks_[i]));
        entries.push_back(entries_[i]);
      }
    }
    tasks_ = std::move(left);
    entries_ = std::move(entries);
  }

  void FlyMaps() {
    for (const FirmwareColumn& column : columns_) {
      const VehicleSignals& signals = column.base.model->signals();
      EnvelopeMap map{column.name, {}, {}, {}};
      const bool complete = SetAxis(column, MapRow(options_.map[0], signals), map.x) &&
                            SetAxis(column, MapRow(options_.map[1], signals), map.y);
      if (complete)
        envelope_.maps.push_back(std::move(map));
      else
        Tell(fmt::format("tiltproof: envelope: no map of {}: one of the faults has no margin", column.name));
    }
    for (EnvelopeMap& map : envelope_.maps) StartMap(map);
    trials_.Fly();
  }

  bool SetAxis(const FirmwareColumn& column, const EnvelopeRow& row, EnvelopeMap::Axis& axis) const {
    for (const EnvelopeEntry& entry : envelope_.entries) {
      if (entry.client != column.name || !entry.row.IsAt(row)) continue;
      if (!entry.margin || !entry.margin->survives) return false;
      axis = {entry.row, entry.severity, MapLevels(entry)};
      return true;
    }
    return false;
  }

  void StartMap(EnvelopeMap& map) {
    const auto column = std::find_if(columns_.begin(), columns_.end(),
                                     [&](const FirmwareColumn& other) { return other.name == map.client; });
    const Scenario& base = column->base.scenario;
    const Scenario both = WithSecondRow(base, map.x.row, map.y.row, column->base.model->signals());
    map.survived.assign(map.y.levels.size(), std::vector<std::optional<bool>>(map.x.levels.size()));
    for (std::size_t i = 0; i < map.y.levels.size(); ++i) {
      for (std::size_t j = 0; j < map.x.levels.size(); ++j) {
        FlightJob job{
            .name = fmt::format("map of {} at {}, {}", map.client, map.x.levels[j], map.y.levels[i]),
            .scenario = AtLevel(AtLevel(both, *FindPlaceholder(base), map.x.severity, map.x.levels[j]),
                                both.faults.size() - 1, map.y.severity, map.y.levels[i]),
            .model = column->base.model,
            .means = column->means,
            .replay = {}};
        trials_.Start(job, [this, &cell = map.survived[i][j]](const TrialResult& result) {
          if (result.answer != TrialResult::Answer::kUnknown)
            cell = result.answer == TrialResult::Answer::kSurvived;
          else
            exit_ = exit_ == kExitError ? exit_ : UnknownExit(result);
          if (!cell.has_value()) Tell("tiltproof: envelope: " + WhyUnknown(result));
        });
      }
    }
  }

  void PrintNotApplicable() const {
    for (const std::string& line : NotApplicableLines(envelope_)) PrintLine(stdout, 0, line);
  }

  // Prints the reason that rows have no margin: most often the scenario itself fails.
  void PrintUnsurvived() const {
    for (const FirmwareColumn& column : columns_) {
      if (const auto broken = broken_.find(column.name); broken != broken_.end()) {
        PrintLine(stdout, 0,
                  fmt::format("{}: fails without any fault, seed {}: {}; so it has no margins", column.name,
                              broken->second.seed, broken->second.reason));
        continue;
      }
      std::size_t count = 0;
      const EnvelopeEntry* first = nullptr;
      for (const EnvelopeEntry& entry : envelope_.entries) {
        if (entry.client != column.name || !entry.margin || entry.margin->survives || entry.margin->unknown)
          continue;
        ++count;
        if (first == nullptr) first = &entry;
      }
      if (first != nullptr)
        PrintLine(stdout, 0,
                  fmt::format("{}: {} of its rows fail at the mildest level already, {} the first: {}; does "
                              "`tiltproof run` of the scenario pass?",
                              column.name, count, first->row.type->name, first->margin->at_fails.reason));
    }
  }

  void Write() const { WriteFile(folder() / "envelope.json", ToJsonText(envelope_)); }

  void ShowProgress() {
    if (!line_.visible()) return;
    const std::size_t here = done_count_ - earlier_count_, all = envelope_.entries.size() - earlier_count_;
    std::string text = fmt::format("{} of {} rows, {} flights", done_count_, envelope_.entries.size(),
                                   trials_.flown_count());
    if (unknown_count_ > 0) text += fmt::format(", {} without a margin", unknown_count_);
    const double passed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    const auto left =
        TimeLeft(static_cast<double>(here) / static_cast<double>(std::max<std::size_t>(all, 1)), passed_s);
    line_.Show(text + (left ? fmt::format(", {} left", DurationText(*left)) : ""));
  }
  void Tell(const std::string& line) {
    line_.Clear();
    Print(stderr, "{}\n", line);
  }

  const EnvelopeOptions& options_;
  link::OwnedDescriptor lock_;  // of the folder
  std::vector<FirmwareColumn> columns_;
  Trials trials_;
  Envelope envelope_;
  std::vector<MarginTask> all_tasks_;          // of entries, in their order
  std::vector<MarginTask> tasks_;              // those to be flown
  std::vector<std::size_t> entries_;           // the place of each task's
  std::map<std::string, TrialResult> broken_;  // firmware that fails without any fault, by column
  std::size_t done_count_ = 0;
  int exit_ = kExitGreen;
  // Rows that an earlier envelope has found, and those whose flights could not be judged.
  std::size_t earlier_count_ = 0, unknown_count_ = 0;
  ProgressLine line_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

int EnvelopeCommand(const EnvelopeOptions& options) {
  const InterruptScope scope;
  return EnvelopeSearch(options, ReadColumns(options)).Run();
}

}  // namespace tiltproof::harness
