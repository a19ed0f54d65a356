#include "harness/cli/flight_worker.h"

#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "harness/client/firmware_files.h"
#include "harness/dds/domain_slot.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/run/flight.h"
#include "harness/run/realtime/realtime_flight.h"
#include "harness/run/run_id.h"
#include "harness/scenario/reader.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// What the monitors of a flight in real time are told of its score.
dds::Score Announced(const ScenarioResult& result) {
  dds::Score score;
  score.scenario = result.name;
  score.verdict = Name(result.score.verdict);
  score.reason = result.score.reason.substr(0, dds::kTextBytesMax);
  score.metrics_json = MetricsJsonText(result);
  return score;
}

// `slot` keeps a free domain for as long as it lives.
BusPlace ChoosePlace(const FlightMeans& means, std::optional<dds::DomainSlot>& slot) {
  BusPlace place;
  place.run_id = NewRunId();
  place.tag = means.attach ? kAttachTag : place.run_id;
  place.domain = means.domain != 0 ? means.domain : means.attach ? kAttachDomain : slot.emplace().domain();
  return place;
}

// `score` makes the result, which a flight in real time announces before it leaves the bus.
// `client`: what must not end before the flight is judged.
RunLog FlyByMeans(const FlightJob& job, WorkerReport& report, const std::atomic<bool>* interrupted,
                  const std::function<const ScenarioResult&(const RunLog&)>& score,
                  std::unique_ptr<Client>& client) {
  std::atomic<std::int64_t>* const progress_ns = &report.progress_ns;
  const Scenario& scenario = job.scenario;
  const FlightMeans& means = job.means;
  std::optional<dds::DomainSlot> slot;
  BusPlace place;
  if (means.realtime || means.distributed == Transport::kDds) {
    place = ChoosePlace(means, slot);
    report.SetPlace(place);
  }
  if (means.realtime)
    return FlyRealtime(scenario, *job.model,
                       {.program = ProgramFile(),
                        .scenario_yaml = WriteResolved(scenario),
                        .client = means.ClientsOf(scenario).front(),
                        .attach = means.attach,
                        .place = place,
                        .interface = means.interface,
                        .peers = means.peers,
                        .score = [&](const RunLog& log) { return Announced(score(log)); },
                        .progress_ns = progress_ns,
                        .interrupted = interrupted});
  const DistributedOptions processes{.transport = means.distributed.value_or(Transport::kSocket),
                                     .program = ProgramFile(),
                                     .scenario_yaml = WriteResolved(scenario),
                                     .clients = means.ClientsOf(scenario),
                                     .place = place,
                                     .progress_ns = progress_ns,
                                     .interrupted = interrupted};
  if (means.distributed) return FlyDistributed(scenario, job.model->signals(), processes);
  if (scenario.has_several_clients()) return FlyClientsApart(scenario, *job.model, processes);
  if (means.FirmwareInWorker(scenario)) FirmwareGuard::Install(&report.firmware);
  FlightOptions options;
  options.retire = [&](std::unique_ptr<Client> retired) { client = std::move(retired); };
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    return MakeClient(processes.clients.front(), SettingsOf(scenario), std::move(host));
  };
  options.progress_ns = progress_ns;
  options.interrupted = interrupted;
  return Fly(scenario, *job.model, options);
}

// `cut_short`: set when a signal ended the flight.
ScenarioResult FlyJob(const FlightJob& job, WorkerReport& report, const std::atomic<bool>* interrupted,
                      std::unique_ptr<Client>& client, bool& cut_short) {
  const Scenario& scenario = job.scenario;
  std::optional<ScenarioResult> result;
  const auto score = [&](const RunLog& log) -> const ScenarioResult& {
    if (!result) result = MakeResult(job.folder.filename(), scenario, log, job.replay);
    return *result;
  };
  const RunLog log = FlyByMeans(job, report, interrupted, score, client);
  cut_short = log.end_reason == EndReason::kInterrupted;
  // Scoring and writing are progress too, for the parent that watches.
  report.progress_ns.fetch_add(1, std::memory_order_relaxed);
  score(log);
  report.progress_ns.fetch_add(1, std::memory_order_relaxed);
  WriteFlight(job.folder, scenario, log);
  return std::move(*result);
}

}  // namespace

void WorkerReport::SetPlace(const BusPlace& place) {
  domain_ = place.domain;
  std::strncpy(tag_.data(), place.tag.c_str(), tag_.size() - 1);
  std::strncpy(run_id_.data(), place.run_id.c_str(), run_id_.size() - 1);
  has_place_.store(true, std::memory_order_release);
}

std::optional<BusPlace> WorkerReport::Place() const {
  if (!has_place_.load(std::memory_order_acquire)) return std::nullopt;
  return BusPlace{domain_, tag_.data(), run_id_.data()};
}

ScenarioResult ErrorResult(const FlightJob& job, const std::string& reason) {
  return MakeErrorResult(job.folder.filename(), job.scenario, reason, job.replay);
}

void Work(const FlightJob& job, WorkerReport& report, const std::atomic<bool>* interrupted) {
  // Nothing must mix with the results on standard output.
  dup2(STDERR_FILENO, STDOUT_FILENO);
  ScenarioResult result;
  std::unique_ptr<Client> client;
  bool cut_short = false;
  try {
    std::filesystem::create_directories(job.folder);
    WriteFile(job.folder / "scenario.resolved.yaml", WriteResolved(job.scenario));
    try {
      result = FlyJob(job, report, interrupted, client, cut_short);
    } catch (const FileError&) {
      throw;
    } catch (const std::exception& error) {
      result = ErrorResult(job, error.what());
    }
    WriteFile(job.folder / "verdict.json", ToJsonText(result));
  } catch (const std::exception& error) {
    // Then what is printed is heard again.
    client.reset();
    Print(stderr, "tiltproof: {}: {}\n", job.scenario.name, error.what());
    std::strncpy(report.no_verdict_because.data(), error.what(), report.no_verdict_because.size() - 1);
    _exit(kExitWithoutVerdict);
  }
  // Whatever it does now, its flight is judged.
  client.reset();
  // No destructors or exit handlers: they may be the firmware library's.
  _exit(cut_short ? kExitWorkerInterrupted : 0);
}

}  // namespace tiltproof::harness
