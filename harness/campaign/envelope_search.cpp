#include "harness/campaign/envelope_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <utility>

namespace tiltproof::harness {
namespace {

constexpr int kMapLevelsCount = 12;

// From a tenth of a fault's own margin to 1.2 times it.
std::vector<double> MapLevels(const EnvelopeSearchRow& row) {
  const LevelRange& range = row.task.severity.range;
  const double last = row.found->fails.value_or(range.end);
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

template <class Value>
std::string ValueDifference(const std::string& what, const Value& then, const Value& now) {
  return then == now ? "" : fmt::format("{} was {} and is {}", what, then, now);
}
std::string TextDifference(const std::string& what, const std::string& then, const std::string& now) {
  return ValueDifference(what, fmt::format("\"{}\"", then), fmt::format("\"{}\"", now));
}

}  // namespace

EnvelopeSearch::EnvelopeSearch(EnvelopePlan plan, Options options)
    : plan_(std::move(plan)), options_(std::move(options)), trials_(options_.flights, options_.repeat_count) {
  earlier_.complete = true;
}

std::set<std::string> EnvelopeSearch::Clients() const {
  std::set<std::string> clients;
  for (const EnvelopeFirmware& firmware : plan_.firmwares) clients.insert(firmware.name);
  return clients;
}

Envelope EnvelopeSearch::envelope() const {
  const Scenario& base = plan_.firmwares.front().flight.scenario;
  Envelope envelope = earlier_;
  envelope.version = Version();
  envelope.scenario = base.name;
  envelope.clients.clear();
  for (const EnvelopeFirmware& firmware : plan_.firmwares) {
    envelope.clients.push_back(firmware.name);
    envelope.columns[firmware.name] = firmware.column;
  }
  envelope.clients.insert(envelope.clients.end(), earlier_.clients.begin(), earlier_.clients.end());
  envelope.seed = base.seed;
  envelope.repeats = options_.repeat_count;
  envelope.tolerance = options_.tolerance;
  envelope.complete = complete_ && earlier_.complete;
  envelope.rows.clear();
  for (const EnvelopeSearchRow& row : plan_.rows)
    if (row.found) envelope.rows.push_back(*row.found);
  envelope.rows.insert(envelope.rows.end(), earlier_.rows.begin(), earlier_.rows.end());
  envelope.not_applicable = plan_.not_applicable;
  envelope.not_applicable.insert(envelope.not_applicable.end(), earlier_.not_applicable.begin(),
                                 earlier_.not_applicable.end());
  envelope.map = maps_;
  envelope.map.insert(envelope.map.end(), earlier_.map.begin(), earlier_.map.end());
  return envelope;
}

std::string EnvelopeSearch::DifferenceFrom(const Envelope& earlier) const {
  const Envelope now = envelope();
  for (const std::string& found : {TextDifference("the version", earlier.version, now.version),
                                   TextDifference("the scenario", earlier.scenario, now.scenario),
                                   ValueDifference("the seed", earlier.seed, now.seed),
                                   ValueDifference("--repeats", earlier.repeats, now.repeats),
                                   ValueDifference("--tolerance", earlier.tolerance, now.tolerance)})
    if (!found.empty()) return found;
  for (const EnvelopeFirmware& firmware : plan_.firmwares) {
    const auto then = earlier.columns.find(firmware.name);
    if (then == earlier.columns.end()) continue;
    if (then->second.scenario != firmware.column.scenario)
      return fmt::format("the scenario, or the vehicle, of {} was another one", firmware.name);
    if (then->second.build != firmware.column.build)
      return fmt::format("{} was flown with another build of the program or the firmware", firmware.name);
  }
  return "";
}

Envelope EnvelopeSearch::NotSelected(const Envelope& earlier) const {
  const std::set<std::string> clients = Clients();
  std::set<std::pair<std::string, std::string>> types;  // each with its client
  for (const EnvelopeSearchRow& row : plan_.rows) types.insert({std::string(row.row.type->name), row.client});
  for (const EnvelopeNotApplicable& other : plan_.not_applicable) types.insert({other.type, other.client});
  const bool flies_maps = std::any_of(plan_.firmwares.begin(), plan_.firmwares.end(),
                                      [](const EnvelopeFirmware& firmware) { return !firmware.map.empty(); });
  Envelope left = earlier;
  std::erase_if(left.clients, [&](const std::string& client) { return clients.contains(client); });
  std::erase_if(left.columns, [&](const auto& column) { return clients.contains(column.first); });
  std::erase_if(left.rows, [&](const EnvelopeEntry& entry) {
    return std::any_of(plan_.rows.begin(), plan_.rows.end(), [&](const EnvelopeSearchRow& row) {
      return row.client == entry.client && PlaceOf(row.row).IsAt(entry);
    });
  });
  std::erase_if(left.not_applicable, [&](const EnvelopeNotApplicable& other) {
    return types.contains({other.type, other.client});
  });
  // A run with a map flies it again.
  std::erase_if(left.map, [&](const EnvelopeMap& map) { return flies_maps && clients.contains(map.client); });
  left.complete = earlier.complete || left.rows.empty();
  return left;
}

void EnvelopeSearch::Resume(const Envelope& earlier) {
  if (const std::string why = DifferenceFrom(earlier); !why.empty()) throw std::runtime_error(why);
  for (EnvelopeSearchRow& row : plan_.rows) {
    const EnvelopePlace place = PlaceOf(row.row);
    for (const EnvelopeEntry& entry : earlier.rows)
      if ((!entry.error || entry.never_acted()) && entry.client == row.client && entry.IsAt(place))
        row.found = entry;
  }
  earlier_ = NotSelected(earlier);
  resumed_count_ = done_count();
}

std::size_t EnvelopeSearch::done_count() const {
  const auto done = [](const EnvelopeSearchRow& row) { return row.found.has_value(); };
  return static_cast<std::size_t>(std::count_if(plan_.rows.begin(), plan_.rows.end(), done));
}

void EnvelopeSearch::Run() {
  FlyWithoutFaults();
  FindRows();
  if (!interrupted()) FlyMaps();
  complete_ = !interrupted();
}

void EnvelopeSearch::Found(EnvelopeSearchRow& row, const Margin& margin) const {
  row.found = EntryOf(row.row, row.client, row.task.severity, margin, options_.repeat_count);
}

// A firmware that fails without any fault survives no level of any: its rows need no flights.
void EnvelopeSearch::FlyWithoutFaults() {
  for (const EnvelopeFirmware& firmware : plan_.firmwares) {
    if (std::none_of(plan_.rows.begin(), plan_.rows.end(),
                     [&](const EnvelopeSearchRow& row) { return row.client == firmware.name && !row.found; }))
      continue;
    FlightJob job = firmware.flight;
    job.name = fmt::format("no fault, of {}", firmware.name);
    trials_.Start(job, [this, name = firmware.name](const TrialResult& result) {
      if (result.answer == TrialResult::Answer::kFailed) broken_.emplace(name, result);
    });
  }
  trials_.Fly();
  for (EnvelopeSearchRow& row : plan_.rows) {
    const auto broken = broken_.find(row.client);
    if (row.found || broken == broken_.end()) continue;
    Margin margin;
    margin.fails = row.task.severity.range.start;
    margin.at_fails = broken->second;
    Found(row, margin);
  }
}

void EnvelopeSearch::FindRows() {
  std::vector<MarginTask> tasks;
  std::vector<std::size_t> places;  // of each task's row
  for (std::size_t i = 0; i < plan_.rows.size(); ++i) {
    if (plan_.rows[i].found) continue;
    tasks.push_back(plan_.rows[i].task);
    places.push_back(i);
  }
  FindMargins(trials_, tasks,
              {.tolerance = options_.tolerance,
               .at_once_count = 2 * static_cast<std::size_t>(options_.flights.jobs_count) + 2,
               .on_done = [&](std::size_t task, const Margin& margin) {
                 EnvelopeSearchRow& row = plan_.rows[places[task]];
                 Found(row, margin);
                 if (margin.unknown) {
                   options_.on_unknown(*margin.unknown);
                   options_.flights.tell("envelope: no margin: " + WhyUnknown(*margin.unknown));
                 }
                 options_.on_row(row);
               }});
}

std::optional<EnvelopeMap::Axis> EnvelopeSearch::AxisOf(const std::string& client,
                                                        const EnvelopeRow& row) const {
  for (const EnvelopeSearchRow& searched : plan_.rows) {
    if (searched.client != client || !searched.row.IsAt(row)) continue;
    if (!searched.found || !searched.found->survives) return std::nullopt;
    EnvelopeMap::Axis axis;
    static_cast<EnvelopePlace&>(axis) = PlaceOf(row);
    axis.parameter = searched.task.severity.parameter;
    axis.unit = searched.task.severity.unit;
    axis.levels = MapLevels(searched);
    return axis;
  }
  return std::nullopt;
}

void EnvelopeSearch::FlyMaps() {
  std::vector<const EnvelopeFirmware*> firmwares;  // of each map
  for (const EnvelopeFirmware& firmware : plan_.firmwares) {
    if (firmware.map.empty()) continue;
    const auto x = AxisOf(firmware.name, firmware.map.at(0)), y = AxisOf(firmware.name, firmware.map.at(1));
    if (!x || !y) {
      options_.flights.tell(
          fmt::format("envelope: no map of {}: one of the faults has no margin", firmware.name));
      continue;
    }
    maps_.push_back({.client = firmware.name, .x = *x, .y = *y, .survived = {}});
    firmwares.push_back(&firmware);
  }
  for (std::size_t i = 0; i < maps_.size(); ++i) StartMap(*firmwares[i], maps_[i]);
  trials_.Fly();
}

void EnvelopeSearch::StartMap(const EnvelopeFirmware& firmware, EnvelopeMap& map) {
  const Scenario& base = firmware.flight.scenario;
  const Scenario both =
      WithSecondRow(base, firmware.map.at(0), firmware.map.at(1), firmware.flight.model->signals());
  const auto severity = [&](const EnvelopeRow& of) {
    return std::find_if(
               plan_.rows.begin(), plan_.rows.end(),
               [&](const EnvelopeSearchRow& row) { return row.client == firmware.name && row.row.IsAt(of); })
        ->task.severity;
  };
  const Severity x = severity(firmware.map.at(0)), y = severity(firmware.map.at(1));
  map.survived.assign(map.y.levels.size(), std::vector<std::optional<bool>>(map.x.levels.size()));
  for (std::size_t i = 0; i < map.y.levels.size(); ++i) {
    for (std::size_t j = 0; j < map.x.levels.size(); ++j) {
      FlightJob job = firmware.flight;
      job.name = fmt::format("map of {} at {}, {}", map.client, map.x.levels[j], map.y.levels[i]);
      job.scenario = AtLevel(AtLevel(both, *FindPlaceholder(base), x, map.x.levels[j]),
                             both.faults.size() - 1, y, map.y.levels[i]);
      trials_.Start(job, [this, &cell = map.survived[i][j]](const TrialResult& result) {
        if (result.answer != TrialResult::Answer::kUnknown) {
          cell = result.answer == TrialResult::Answer::kSurvived;
          return;
        }
        options_.on_unknown(result);
        options_.flights.tell("envelope: " + WhyUnknown(result));
      });
    }
  }
}

}  // namespace tiltproof::harness
