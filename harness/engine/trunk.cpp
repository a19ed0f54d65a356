#include "harness/engine/trunk.h"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "faults/random.h"
#include "faults/registry.h"
#include "harness/engine/process_state.h"
#include "harness/run/archive.h"

namespace tiltproof::harness {
namespace {

// The frames of this time before the fault's begin may reach into its window.
constexpr TimeNs kBeforeFaultNs = 100 * kNsPerMs;
// A shorter past is not worth a process.
constexpr TimeNs kPastNsMin = kNsPerS / 2;

void ReadAll(int channel, void* bytes, std::size_t size) {
  ssize_t count = -1;
  do {
    count = recv(channel, bytes, size, MSG_WAITALL);
  } while (count < 0 && errno == EINTR);
  // The parent has no further flight. No destructors or exit handlers: they may be the firmware library's.
  if (count != static_cast<ssize_t>(size)) _exit(0);
}

}  // namespace

bool CanDepart(const FlightJob& job) {
  const FlightMeans& means = job.means;
  const Scenario& scenario = job.scenario;
  if (!job.departure || job.departure->fault >= scenario.faults.size()) return false;
  const faults::FaultSpec& fault = scenario.faults[job.departure->fault];
  const faults::FaultType* type = faults::FindFaultType(fault.type);
  return type != nullptr &&
         type->IsOneOf<faults::WireKind, faults::SensorKind, faults::ActuatorKind, faults::PlantKind>() &&
         !faults::WaitsForEvent(fault) && fault.start_ns != kPowerOn &&
         fault.start_ns >= kPastNsMin + kBeforeFaultNs && means.FirmwareInWorker(scenario) && !means.debug &&
         !job.recorder.begin && !job.recorder.end && !job.coverage && !job.tells_end && !job.observe &&
         !job.steer && !job.future && !job.forks;
}

std::vector<std::uint8_t> GivenFault(const FlightJob& job) {
  const faults::FaultSpec& fault = job.scenario.faults[job.departure->fault];
  Packer packer;
  packer(fault.end_ns, fault.parameters);
  const std::uint64_t size = packer.bytes().size();
  std::vector<std::uint8_t> message(sizeof size + size);
  std::memcpy(message.data(), &size, sizeof size);
  std::memcpy(message.data() + sizeof size, packer.bytes().data(), size);
  return message;
}

Trunk::Trunk(const FlightJob& job, WorkerReport& report, int channel, const std::atomic<bool>* interrupted)
    : job_(job), report_(report), channel_(channel), interrupted_(interrupted) {}

RunLog Trunk::Fly(const FlightOptions& options, const std::function<RunLog(const FlightOptions&)>& fly,
                  Scenario& flown, std::uint64_t& drawn_before) {
  FlightOptions open = options;
  open.open = job_.departure->fault;
  open.moments = {job_.scenario.faults[*open.open].start_ns - kBeforeFaultNs};
  open.at_moment = [&](std::size_t /*moment*/) -> std::optional<Future> {
    Future future;
    future.given = flown.faults[*open.open] = Depart();
    return future;
  };
  try {
    return fly(open);
  } catch (const faults::OpenFaultActs&) {
    // Something that was sent before the trunk waits reaches into the fault's window: an overloaded line.
    drawn_before = faults::Random::DrawnCount();
    return fly(options);
  }
}

// Returns in a copy: its flight's fault.
faults::FaultSpec Trunk::Depart() {
  report_.EndOthers();
  faults::FaultSpec fault = job_.scenario.faults[job_.departure->fault];
  if (ThreadCount() > 1) return fault;
  while (!IsCopy()) fault = Next();
  return fault;
}

// In the worker itself it returns once the copy has ended in order.
bool Trunk::IsCopy() {
  const pid_t worker = getpid();
  const pid_t copy = fork();
  if (copy < 0) throw std::runtime_error(fmt::format("cannot fork a flight: {}", std::strerror(errno)));
  if (copy > 0) {
    Await(copy);
    return false;
  }
  // A copy never outlives its worker.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != worker) _exit(0);
  report_.flier = getpid();
  FirmwareGuard::Install(&report_.firmware);
  return true;
}

// A copy that did not end in order takes the worker with it, in the same way: the parent knows only the worker.
void Trunk::Await(int copy) const {
  int status = 0;
  bool told = false;
  while (waitpid(copy, &status, 0) < 0 && errno == EINTR) {
    if (told || interrupted_ == nullptr || !interrupted_->load(std::memory_order_relaxed)) continue;
    told = true;
    kill(copy, SIGINT);
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
  if (WIFEXITED(status)) _exit(WEXITSTATUS(status));
  signal(WTERMSIG(status), SIG_DFL);
  raise(WTERMSIG(status));
  _exit(kExitWithoutResult);
}

faults::FaultSpec Trunk::Next() const {
  if (!AskForNext(channel_)) _exit(0);
  std::uint64_t size = 0;
  ReadAll(channel_, &size, sizeof size);
  std::vector<std::uint8_t> bytes(size);
  ReadAll(channel_, bytes.data(), bytes.size());
  report_.begun = true;
  faults::FaultSpec fault = job_.scenario.faults[job_.departure->fault];
  Unpacker unpacker(bytes);
  unpacker(fault.end_ns, fault.parameters);
  return fault;
}

}  // namespace tiltproof::harness
