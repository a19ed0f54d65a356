#include "harness/client/debugger.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <fstream>
#include <utility>

namespace tiltproof::harness {
namespace {

constexpr int kDebuggerLook_ms = 20;

std::string When(const DebugStop& stop) {
  return stop.at_ns ? fmt::format("at {} s of the flight", ToSeconds(*stop.at_ns)) : "at power-on";
}

// proc(5), status: TracerPid.
bool HasDebugger() {
  std::ifstream status("/proc/self/status");
  for (std::string key; status >> key;) {
    if (long pid = 0; key == "TracerPid:") return status >> pid && pid != 0;
  }
  return false;
}

class DebuggedLibrary final : public Client {
 public:
  DebuggedLibrary(std::unique_ptr<Client> library, const DebugStop& stop)
      : library_(std::move(library)), stop_(stop) {}

  bool RunsOn() const override { return library_->RunsOn(); }
  BootTime Start(BootTime now) override {
    if (!stop_.at_ns) Wait();
    return library_->Start(now);
  }
  void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> marks) override {
    LookAt(arrival);
    library_->Receive(uart, arrival, bytes, marks);
  }
  BootTime Grant(BootTime now, BootTime horizon) override {
    LookAt(now);
    return library_->Grant(now, horizon);
  }
  void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) override {
    origin_ = origin;
    library_->Command(commands, origin);
  }
  BootTime Add(const std::vector<faults::DeviceCommand>& commands) override {
    return library_->Add(commands);
  }
  std::optional<ClientStatus> Status() override { return library_->Status(); }
  ClientSample Sample() override { return library_->Sample(); }

 private:
  void LookAt(BootTime now) {
    if (stop_.at_ns && origin_.known() && now >= origin_.ToBootTime(*stop_.at_ns)) Wait();
  }
  // Once: it may leave before the end.
  void Wait() {
    if (std::exchange(waited_, true)) return;
    // By any process of this user (Yama, ptrace_scope 1).
    prctl(PR_SET_PTRACER, PR_SET_PTRACER_ANY);
    while (!HasDebugger()) poll(nullptr, 0, kDebuggerLook_ms);
  }

  std::unique_ptr<Client> library_;
  DebugStop stop_;
  Origin origin_;
  bool waited_ = false;
};

}  // namespace

std::string HowToDebugImage(const std::string& image, const DebugStop& stop) {
  return fmt::format(
      "{} the processor stops; it continues when a debugger resumes it: gdb-multiarch {} -ex 'target remote "
      ":{}'",
      When(stop), image, stop.port);
}

std::string HowToDebugLibrary(const DebugStop& stop) {
  return fmt::format("{} the firmware waits for a debugger: gdb -p {}", When(stop), getpid());
}

std::unique_ptr<Client> WaitForDebugger(std::unique_ptr<Client> library, const DebugStop& stop) {
  return std::make_unique<DebuggedLibrary>(std::move(library), stop);
}

}  // namespace tiltproof::harness
