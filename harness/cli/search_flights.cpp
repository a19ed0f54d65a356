#include "harness/cli/search_flights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "faults/registry.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/client/firmware_files.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {

FlightMeans LockstepMeans(RunClients clients, const std::string& command) {
  FlightMeans means;
  means.clients = std::move(clients);
  for (const ClientSpec& client : means.clients.Named())
    if (!AbilitiesOf(client, false).virtual_time)
      throw UsageError(
          fmt::format("--client {}: it knows no virtual time, and {} flies in lockstep: give it host, "
                      "library:FILE, program:CMD or qemu",
                      ToText(client), command));
  return means;
}

Suite LoadOneScenario(const std::filesystem::path& path, const RunClients& clients,
                      const std::string& command, const std::string& build) {
  Suite suite = LoadSuite({path}, clients, build);
  for (const auto& warning : suite.warnings) Print(stderr, "warning: {}\n", warning);
  if (suite.scenarios.size() != 1)
    throw UsageError(fmt::format("{}: {} holds {} scenarios; {} takes one", command, path.string(),
                                 suite.scenarios.size(), command));
  suite.scenarios.front().named = true;
  return suite;
}

void CheckReady(const FlightMeans& means) {
  const std::vector<ClientSpec> clients = means.clients.Named();
  for (const ClientSpec& client : clients) CheckFirmwareFile(client);
  if (Emulates(clients)) TestLockstep(LockstepPlugin());
}

std::uint64_t FirstSeed(std::optional<std::uint64_t> given, const Scenario& scenario, int repeat_count) {
  const std::uint64_t first = given.value_or(scenario.seed);
  if (kSeedMax - first < static_cast<std::uint64_t>(repeat_count) - 1)
    throw UsageError(
        fmt::format("--repeats {}: from seed {} on the seeds exceed {}", repeat_count, first, kSeedMax));
  return first;
}

void CheckLevels(const MarginTask& task) {
  const LevelRange& range = task.severity.range;
  // A logarithmic search does not begin at 0.
  const double start = range.start == 0 ? range.end * 1e-6 : range.start;
  for (const double level : {range.whole ? std::round(start) : start, range.end}) {
    const Scenario scenario = AtLevel(task.job.scenario, task.fault, task.severity, level);
    for (const faults::Problem& problem : faults::Validate(scenario.faults.at(task.fault)))
      throw SeverityMistake(fmt::format("with {} at {:g}: {}: {}", task.severity.parameter, level,
                                        problem.key, problem.message));
  }
}

int UnknownExit(const TrialResult& unknown) {
  return unknown.verdict == Verdict::kError ? kExitError : kExitUndecided;
}

}  // namespace tiltproof::harness
