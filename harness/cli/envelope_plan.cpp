#include "harness/cli/envelope_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "faults/registry.h"
#include "faults/signal_choice.h"
#include "harness/campaign/campaign_file.h"
#include "harness/campaign/envelope_rows.h"
#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/stated_computing.h"
#include "harness/report/files.h"
#include "harness/run/hash.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

// A firmware: a column of the table.
struct FirmwareColumn {
  std::string name;
  FlightMeans means;
  SuiteScenario base;
};

void RefuseTwins(const std::vector<std::string>& names) {
  for (auto name = names.begin(); name != names.end(); ++name)
    if (std::find(names.begin(), name, *name) != name)
      throw UsageError(fmt::format("envelope: {} is named twice", *name));
}

// `client`: as --client has it, [LABEL=]CLIENT; in a scenario with several clients [ID=]CLIENT. None: the shipped firmware.
FirmwareColumn ReadColumn(const EnvelopeOptions& options, const std::optional<std::string>& client) {
  std::string label = client ? ClientIdOf(*client) : "", text = client.value_or("");
  if (!label.empty()) {
    const Suite plain = LoadOneScenario(options.scenario, {}, "envelope");
    if (plain.scenarios.front().scenario.has_several_clients())
      label.clear();
    else
      text.erase(0, label.size() + 1);
  }
  FirmwareColumn column;
  column.means =
      LockstepMeans(ReadClientFlags(client ? std::vector{text} : std::vector<std::string>()), "envelope");
  Suite suite = LoadOneScenario(options.scenario, column.means.clients, "envelope");
  CheckReady(column.means);
  column.base = std::move(suite.scenarios.front());
  column.base.scenario.seed = FirstSeed(options.seed, column.base.scenario, options.repeat_count);
  if (!FindPlaceholder(column.base.scenario))
    throw UsageError(fmt::format(
        "{}: envelope needs a fault of type {}: where and when it is stated, the faults of the envelope "
        "act (scenarios/envelope/spiral.yaml has one)",
        options.scenario.string(), kPlaceholderType));
  column.name = !label.empty() ? label : client ? *client : column.base.scenario.firmware;
  return column;
}

std::vector<FirmwareColumn> ReadColumns(const EnvelopeOptions& options) {
  RefuseTwins(options.clients);
  RefuseTwins(options.firmware);
  std::vector<FirmwareColumn> shipped, own;
  for (const std::string& client : options.clients) {
    FirmwareColumn column = ReadColumn(options, client);
    const std::vector<ClientSpec> named = column.means.clients.Named();
    const bool builds = std::all_of(named.begin(), named.end(),
                                    [](const ClientSpec& spec) { return AbilitiesOf(spec, false).shipped; });
    (builds && !options.firmware.empty() ? shipped : own).push_back(std::move(column));
  }
  if (options.clients.empty() || (!options.firmware.empty() && shipped.empty()))
    shipped.push_back(ReadColumn(options, std::nullopt));
  if (options.firmware.empty()) {
    own.insert(own.begin(), shipped.begin(), shipped.end());
  } else {
    if (shipped.size() > 1)
      throw UsageError(
          "envelope: --firmware needs one --client that flies the shipped firmware: each build is a column, "
          "and so is each client");
    std::vector<FirmwareColumn> builds;
    for (const std::string& build : options.firmware) {
      CheckBuild(build);
      FirmwareColumn& column = builds.emplace_back(shipped.front());
      column.base.scenario.FlyFirmware(build);
      column.name = build;
    }
    own.insert(own.begin(), builds.begin(), builds.end());
  }
  std::vector<std::string> names;
  for (const FirmwareColumn& column : own) names.push_back(column.name);
  RefuseTwins(names);
  return own;
}

EnvelopeColumn IdentityOf(const FirmwareColumn& column) {
  const Scenario& scenario = column.base.scenario;
  const std::string text =
      WriteResolved(scenario) + ReadFile(scenario.model_file) + column.means.client_text();
  const std::uint64_t hash =
      Fnv1a({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, kFnvOffset);
  const bool shipped =
      column.means.client_text() == ToText(ClientSpec()) && column.means.clients.by_id.empty();
  return {fmt::format("{:016x}", hash), shipped ? "" : ClientFlagsOf(column.means.clients),
          BuildOf(column.means.clients)};
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
    const auto matches = [&](const auto& type) { return MatchesType(pattern, type.name); };
    if (std::none_of(faults::FaultTypes().begin(), faults::FaultTypes().end(), matches))
      throw UsageError(
          fmt::format("--types {}: matches no fault type; `tiltproof faults` prints them all", pattern));
  }
  for (const faults::FaultType& type : faults::FaultTypes()) {
    const bool wanted =
        options.types.empty()
            ? options.map.empty()
            : std::any_of(options.types.begin(), options.types.end(),
                          [&](const std::string& pattern) { return MatchesType(pattern, type.name); });
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

// Sorts a column's rows into those that its firmware can take and the others.
void AddColumn(const FirmwareColumn& column, const std::vector<EnvelopeRow>& rows, EnvelopePlan& plan) {
  const VehicleSignals& signals = column.base.model->signals();
  const auto leave_out = [&](const EnvelopeRow& row, const std::string& reason) {
    plan.not_applicable.push_back({std::string(row.type->name), row.place + row.side, column.name, reason});
  };
  std::vector<std::string> reasons = ReasonsAgainst(column.means, column.base, rows);
  std::optional<std::string> no_computing;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!reasons[i].empty() || rows[i].type->needs != faults::Needs::kComputing) continue;
    if (!no_computing) no_computing = WhyNoComputing(column.means, column.base);
    reasons[i] = *no_computing;
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const EnvelopeRow& row = rows[i];
    if (!reasons[i].empty()) {
      leave_out(row, reasons[i]);
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
    plan.rows.push_back({.row = row, .client = column.name, .task = std::move(task)});
  }
}

}  // namespace

EnvelopePlan PlanEnvelope(const EnvelopeOptions& options) {
  EnvelopePlan plan;
  for (const FirmwareColumn& column : ReadColumns(options)) {
    const VehicleSignals signals = column.base.model->signals();
    EnvelopeFirmware& firmware = plan.firmwares.emplace_back();
    firmware.name = column.name;
    firmware.column = IdentityOf(column);
    firmware.flight = FlightJob{.name = column.name,
                                .scenario = column.base.scenario,
                                .model = column.base.model,
                                .means = column.means,
                                .replay = {}};
    for (const std::string& text : options.map) firmware.map.push_back(MapRow(text, signals));
    AddColumn(column, RowsOf(options, signals), plan);
  }
  return plan;
}

}  // namespace tiltproof::harness
