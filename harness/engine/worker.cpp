#include "harness/engine/worker.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "faults/random.h"
#include "harness/client/debugger.h"
#include "harness/client/firmware_files.h"
#include "harness/dds/domain_slot.h"
#include "harness/engine/process_state.h"
#include "harness/engine/trunk.h"
#include "harness/process/orphans.h"
#include "harness/run/archive.h"
#include "harness/run/client_parameters.h"
#include "harness/run/flight.h"
#include "harness/run/realtime/realtime_flight.h"
#include "harness/run/run_id.h"
#include "harness/scenario/protocol_file.h"
#include "harness/scenario/reader.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// The flight was flown, or not, but what it should leave on the disk is not there.
struct RecordingError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The score that the monitors of a flight in real time receive.
dds::Score Announced(const FlightResult& result) {
  dds::Score score;
  score.scenario = result.name;
  score.verdict = Name(result.score.verdict);
  score.reason = result.score.reason.substr(0, dds::kTextBytesMax);
  score.metrics_json = nlohmann::json(result.score.metrics).dump();
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

// The job's flight, or its future, or both the flight and futures that are forked from it. `drawn_before`: set for a
// future to the count of numbers that were drawn at random before it departs.
RunLog FlyOrFork(const FlightJob& job, FlightOptions options, const std::atomic<bool>* interrupted,
                 std::uint64_t& drawn_before) {
  options.future = job.future;
  if (job.future && job.future->from_ns != kPowerOn) {
    options.moments = {job.future->from_ns};
    options.at_moment = [&drawn_before](std::size_t /*moment*/) -> std::optional<Future> {
      drawn_before = faults::Random::DrawnCount();
      return std::nullopt;
    };
  }
  const auto fly = [&](const FlightOptions& chosen) { return Fly(job.scenario, *job.model, chosen); };
  if (!job.forks) return fly(options);
  return ForkedFutures(*job.forks, job.scenario, interrupted).Fly(std::move(options), fly);
}

void PrintHowToDebug(const ClientSpec& spec, const ClientSettings& settings, const DebugStop& stop) {
  const auto dialect = DialectOf(*settings.protocol);
  Print(stderr, "tiltproof: {}\n",
        std::holds_alternative<EmulatedImage>(spec)
            ? HowToDebugImage(FirmwareFile(spec, settings.firmware, dialect).string(), stop)
            : HowToDebugLibrary(stop));
}

// `score` makes the result, which a flight in real time announces before it leaves the bus.
// `drawn_before`: as FlyOrFork() sets it.
// `client`: what must not end before the flight is judged. `flown`: gets the changes of a steered flight.
RunLog FlyByMeans(const FlightJob& job, Scenario& flown, WorkerReport& report, int channel,
                  const std::atomic<bool>* interrupted,
                  const std::function<const FlightResult&(const RunLog&)>& score,
                  const Injections* injections, std::uint64_t& drawn_before,
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
                        .clients = means.ClientsOf(scenario),
                        .attach = means.attach,
                        .place = place,
                        .interface = means.interface,
                        .peers = means.peers,
                        .score = [&](const RunLog& log) { return Announced(score(log)); },
                        .injections = injections,
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
  FlightOptions options;
  options.progress_ns = progress_ns;
  options.interrupted = interrupted;
  options.flown = &flown;
  if (job.steer)
    options.steer = [&](SteeredFlight& flight) {
      job.steer(flight, flown, [&report] { report.progress_ns.fetch_add(1, std::memory_order_relaxed); });
    };
  if (scenario.has_several_clients())
    return FlyClientsApart(scenario, *job.model, processes, std::move(options));
  if (means.FirmwareInWorker(scenario)) FirmwareGuard::Install(&report.firmware);
  options.retire = [&](std::unique_ptr<Client> retired) { client = std::move(retired); };
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    ClientSettings settings = SettingsOf(scenario);
    settings.debug = means.debug;
    settings.coverage = job.coverage;
    settings.lines.faulty = settings.lines.faulty || job.steer;
    settings.parameters = [&] { return ClientParameters(scenario, *job.model); };
    const ClientSpec& spec = processes.clients.front();
    if (means.debug) PrintHowToDebug(spec, settings, *means.debug);
    return MakeClient(spec, settings, std::move(host));
  };
  const std::unique_ptr<RecordSink> observer = job.observe ? job.observe() : nullptr;
  options.observer = observer.get();
  options.keeps_activations = job.recorder.end || observer != nullptr;
  if (!job.departure) return FlyOrFork(job, std::move(options), interrupted, drawn_before);
  const auto fly = [&](const FlightOptions& chosen) { return Fly(scenario, *job.model, chosen); };
  return Trunk(job, report, channel, interrupted).Fly(options, fly, flown, drawn_before);
}

// A firmware that has changed what the flight's results depend on has failed, however it flew.
void BlameForChanges(const ProcessState& before, RunLog& log) {
  const std::string what = before.WhatChanged();
  if (what.empty()) return;
  before.RestoreLimits();
  if (WentAway(log.end_reason)) return;
  log.end_reason = EndReason::kFirmwareCrashed;
  log.end_text = "the firmware " + what;
}

// `before`: of this process, where the firmware runs in it. `cut_short`: set when a signal ended the flight.
FlightResult FlyJob(const FlightJob& job, WorkerReport& report, int channel,
                    const std::atomic<bool>* interrupted, const std::optional<ProcessState>& before,
                    std::unique_ptr<Client>& client, bool& cut_short) {
  Scenario scenario = job.scenario;  // as flown: with what is injected
  std::optional<Injections> injections;
  if (job.means.realtime && job.injections) {
    injections = job.injections();
    injections->answer = [&scenario, tell = injections->answer](const Injections::Answer& answer) {
      if (answer.accepted) scenario.faults.push_back(answer.fault);
      tell(answer);
    };
  }
  std::optional<FlightResult> result;
  const auto score = [&](const RunLog& log) -> const FlightResult& {
    if (!result)
      result =
          MakeResult(job.name, job.future ? WithFuture(scenario, *job.future) : scenario, log, job.replay);
    return *result;
  };
  std::uint64_t drawn_before = faults::Random::DrawnCount();
  RunLog log = FlyByMeans(job, scenario, report, channel, interrupted, score,
                          injections ? &*injections : nullptr, drawn_before, client);
  report.EndOthers();
  if (before) BlameForChanges(*before, log);
  // Flights of several processes draw elsewhere.
  const bool drew_here = !job.means.realtime && !job.means.distributed && !scenario.has_several_clients();
  const bool is_of_any_seed = drew_here && faults::Random::DrawnCount() == drawn_before;
  cut_short = log.end_reason == EndReason::kInterrupted;
  // Scoring and recording are progress too, for the parent that watches.
  report.progress_ns.fetch_add(1, std::memory_order_relaxed);
  score(log);
  result->is_of_any_seed = is_of_any_seed;
  if (job.coverage && client) {
    Coverage coverage = client->CodeCoverage();
    result->coverage_kind = coverage.kind;
    result->coverage = std::move(coverage.features);
  }
  if (job.tells_end && client)
    if (const auto trouble = client->End()) {
      result->events.push_back(
          {ToSeconds(log.end_ns), std::string(kEndFailedEvent), std::nullopt, trouble->what()});
      result->firmware_end = trouble->end;
    }
  report.progress_ns.fetch_add(1, std::memory_order_relaxed);
  try {
    const bool changed = job.steer || scenario.faults.size() > job.scenario.faults.size();
    if (changed && job.recorder.begin) job.recorder.begin(scenario);
    if (job.recorder.end) job.recorder.end(scenario, log, *result);
  } catch (const std::exception& error) {
    throw RecordingError(error.what());
  }
  return std::move(*result);
}

WorkerResult FlyAndRecord(const FlightJob& job, WorkerReport& report, int channel,
                          const std::atomic<bool>* interrupted, std::unique_ptr<Client>& client) {
  WorkerResult done;
  std::optional<ProcessState> before;
  if (job.means.FirmwareInWorker(job.scenario)) before.emplace();
  try {
    try {
      if (job.recorder.begin) job.recorder.begin(job.scenario);
    } catch (const std::exception& error) {
      throw RecordingError(error.what());
    }
    done.result = FlyJob(job, report, channel, interrupted, before, client, done.cut_short);
  } catch (const RecordingError& error) {
    done.recording_trouble = error.what();
    done.result = ErrorResult(job, fmt::format("the flight's results are missing: {}", error.what()));
  } catch (const std::bad_alloc&) {
    done.result = FailedOutsideCalls(job, "the worker process ran out of memory",
                                     report.progress_ns.load(std::memory_order_relaxed));
  } catch (const std::length_error& error) {
    done.result = FailedOutsideCalls(job, fmt::format("the worker process failed ({})", error.what()),
                                     report.progress_ns.load(std::memory_order_relaxed));
  } catch (const std::exception& error) {
    done.result = ErrorResult(job, error.what());
  }
  // A failure here may be the firmware's doing.
  if (before && done.result.score.verdict == Verdict::kError)
    if (const std::string what = before->WhatChanged(); !what.empty()) {
      done.result = ErrorResult(job, fmt::format("the firmware {}: {}", what, done.result.score.reason));
      done.result.score.verdict = Verdict::kFail;
      done.result.score.cause = VerdictCause::kFirmware;
      done.result.outcome = Outcome::kCrashed;
    }
  return done;
}

constexpr std::uint8_t kAsksForNext = 1;

// Size of a whole result at the start of `bytes`, which is its size and then so many bytes; nullopt: it is not whole.
std::optional<std::uint64_t> BodySize(std::span<const std::uint8_t> bytes) {
  std::uint64_t size = 0;
  if (bytes.size() < sizeof size) return std::nullopt;
  std::memcpy(&size, bytes.data(), sizeof size);
  if (size == 0 || bytes.size() - sizeof size < size) return std::nullopt;
  return size;
}

// The parent reads while the worker lives, and takes the worker with it when it ends.
bool WriteAll(int descriptor, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

// True if the result was handed over.
bool FlyAndHandOver(const FlightJob& job, WorkerReport& report, int channel,
                    const std::atomic<bool>* interrupted) {
  std::unique_ptr<Client> client;
  const WorkerResult done = FlyAndRecord(job, report, channel, interrupted, client);
  report.EndOthers();
  const std::vector<std::uint8_t> packed = Pack(done.result);
  const std::uint64_t size = packed.size() + 1;
  std::vector<std::uint8_t> message(sizeof size + size);
  std::memcpy(message.data(), &size, sizeof size);
  message[sizeof size] = done.cut_short ? 1 : 0;
  std::copy(packed.begin(), packed.end(), message.begin() + sizeof size + 1);
  // A firmware may have closed what is not its own.
  const bool handed_over = WriteAll(channel, message);
  // Whatever it does now, its flight is judged.
  client.reset();
  EndOrphans();
  // While the client lived, what is printed was taken for its own.
  if (!done.recording_trouble.empty())
    Print(stderr, "tiltproof: {}: {}\n", job.scenario.name, done.recording_trouble);
  return handed_over;
}

// The job that the parent gives to this process next. It ends this process when it has none.
const FlightJob* NextOf(const KnownJobs& known, int channel) {
  if (!AskForNext(channel)) return nullptr;
  std::uint64_t number = 0;
  ssize_t count = -1;
  do {
    count = recv(channel, &number, sizeof number, MSG_WAITALL);
  } while (count < 0 && errno == EINTR);
  return count == sizeof number ? known.find(number) : nullptr;
}

}  // namespace

std::optional<WorkerResult> ReadWorkerResult(std::span<const std::uint8_t> bytes) {
  const auto size = BodySize(bytes);
  if (!size) return std::nullopt;
  const auto body = bytes.subspan(sizeof *size, *size);
  return WorkerResult{
      .cut_short = body[0] != 0, .result = UnpackFlightResult(body.subspan(1)), .recording_trouble = {}};
}

bool AsksForNext(std::span<const std::uint8_t> bytes) {
  const auto size = BodySize(bytes);
  return size && bytes.size() > sizeof *size + *size;
}

bool AskForNext(int channel) { return WriteAll(channel, std::array{kAsksForNext}); }

void WorkerReport::EndOthers() const {
  if (getpid() != flier) _Exit(0);
}

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

void Work(const FlightJob& first, WorkerReport& report, int channel, const std::atomic<bool>* interrupted,
          const KnownJobs& known) noexcept {
  AdoptOrphans();
  // Nothing must mix with the results on standard output.
  dup2(STDERR_FILENO, STDOUT_FILENO);
  // A firmware may have lowered the limit on the size of files: writing fails then, with a reason.
  signal(SIGXFSZ, SIG_IGN);
  const auto is_interrupted = [&] {
    return interrupted != nullptr && interrupted->load(std::memory_order_relaxed);
  };
  const FlightJob* job = &first;
  FlightJob next;
  const pid_t worker = getpid();
  do {
    report.flier = worker;
    report.begun = true;
    if (!FlyAndHandOver(*job, report, channel, interrupted)) _exit(kExitWithoutResult);
    // A process in which a flight has departed is a copy.
    const bool goes_on = !job->departure && job->means.SharesWorker(job->scenario) &&
                         !FirmwareGuard::HasLeftCalls() && !is_interrupted();
    const FlightJob* given = goes_on ? NextOf(known, channel) : nullptr;
    if (given == nullptr) break;
    next = *given;
    next.departure.reset();
    job = &next;
  } while (!is_interrupted());
  // No destructors or exit handlers: they may be the firmware library's.
  _exit(0);
}

}  // namespace tiltproof::harness
