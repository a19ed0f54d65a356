#include "harness/cli/envelope_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "harness/campaign/envelope_rows.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/search_flights.h"
#include "harness/report/files.h"
#include "harness/run/hash.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

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

}  // namespace

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
  return {column.name, fmt::format("{:016x}", hash), shipped ? "" : ClientFlagsOf(column.means.clients),
          BuildOf(column.means.clients)};
}

}  // namespace tiltproof::harness
