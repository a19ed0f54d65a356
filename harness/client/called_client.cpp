#include "harness/client/called_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "link/overloaded.h"

namespace tiltproof::harness {
namespace {

// Looking for output takes a while.
constexpr TimeNs kLogPeriod = 12 * kNsPerMs;
// Limits of what a firmware states: a begin after the present time, and a length on a sound processor.
constexpr TimeNs kComputeAheadMax = kNsPerS, kComputeMax = 3600 * kNsPerS;

}  // namespace

BootTime CalledClient::Start(BootTime now) {
  called_ns_ = now;
  wake_ns_ = WaitsFor(StartFirmware(clock_.At(now)));
  LogOutput(now);
  return wake_ns_;
}

void CalledClient::Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
                           std::span<const faults::ReceiveMark> /*marks*/) {
  called_ns_ = arrival;
  if (!in_reset_) ReceiveInFirmware(uart, clock_.At(arrival), bytes);
}

BootTime CalledClient::Grant(BootTime now, BootTime /*horizon*/) {
  called_ns_ = now;
  for (; !clock_events_.empty() && now >= clock_events_.front().time_ns; clock_events_.pop_front())
    host_.event(clock_events_.front());
  // Resets that begin while it is held hold it until the last has ended.
  for (; !resets_.empty() && now >= resets_.front().begin; resets_.pop_front()) {
    in_reset_ = true;
    held_until_ = std::max(held_until_, resets_.front().end);
    host_.event({.time_ns = now,
                 .fault = resets_.front().fault,
                 .kind = kResetEvent,
                 .text = "reset, and held until it has booted"});
  }
  if (!in_reset_) {
    wake_ns_ = Run(now);
  } else if (now < held_until_) {
    wake_ns_ = held_until_;
    wake_shown_.reset();
  } else {
    in_reset_ = false;
    host_.event({.time_ns = now, .fault = std::nullopt, .kind = "device_runs", .text = "it has booted"});
    wake_ns_ = WaitsFor(ResetFirmware(clock_.At(now)));
  }
  if (now - logged_ns_ >= kLogPeriod) LogOutput(now);
  return Next();
}

BootTime CalledClient::Next() const {
  return resets_.empty() ? wake_ns_ : std::min(wake_ns_, resets_.front().begin);
}

BootTime CalledClient::WaitsFor(TimeNs shown) {
  wake_shown_ = shown;
  return clock_.When(shown);
}

// Until when it waits.
BootTime CalledClient::Run(BootTime now) {
  if (const auto hold = task_delays_.At(now)) {
    if (std::exchange(task_held_until_, hold->until) != hold->until)
      host_.event({.time_ns = now,
                   .fault = hold->fault,
                   .kind = "task_delayed",
                   .text = fmt::format("held for {:.6g} ms", ToSeconds(hold->until - now) * 1e3)});
    wake_shown_.reset();
    return hold->until;
  }
  return WaitsFor(RunFirmware(clock_.At(now)));
}

TimeNs CalledClient::Compute(TimeNs shown, TimeNs length_ns, TimeNs deadline) {
  if (!host_.models_computing || length_ns <= 0) return shown;
  const BootTime begin =
      std::clamp(clock_.When(std::max<TimeNs>(shown, 0)), called_ns_, called_ns_ + kComputeAheadMax);
  if (!std::exchange(states_computing_, true))
    host_.event({.time_ns = begin, .fault = std::nullopt, .kind = kComputesEvent, .text = ""});
  const Computation computation =
      ComputeOn(slow_spans_, task_delays_, begin, std::min(length_ns, kComputeMax));
  for (const std::size_t fault : computation.faults)
    host_.event({.time_ns = begin,
                 .fault = fault,
                 .kind = "computing_stretched",
                 .text = fmt::format("computing for {:.6g} ms takes {:.6g} ms", ToSeconds(length_ns) * 1e3,
                                     ToSeconds(computation.end - begin) * 1e3)});
  const TimeNs end = clock_.At(computation.end);
  deadline = std::max<TimeNs>(deadline, 0);
  if (end > deadline)
    host_.event({.time_ns = begin,
                 .fault = std::nullopt,
                 .kind = kDeadlineMissedEvent,
                 .text = fmt::format("computing ends {:.6g} ms after its deadline",
                                     ToSeconds(end - deadline) * 1e3)});
  return end;
}

void CalledClient::Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) {
  origin_ = origin;
  Add(commands);
}

BootTime CalledClient::Add(const std::vector<faults::DeviceCommand>& commands) {
  const auto refuse = [] {
    throw std::logic_error("a library or a program was given a command that it cannot carry out");
  };
  std::deque<DeviceEvent> events = clock_.Follow(commands, origin_);
  clock_events_.insert(clock_events_.end(), events.begin(), events.end());
  const auto is_earlier = [](const DeviceEvent& a, const DeviceEvent& b) { return a.time_ns < b.time_ns; };
  std::stable_sort(clock_events_.begin(), clock_events_.end(), is_earlier);
  task_delays_.Add(commands, origin_);
  slow_spans_.Add(commands, origin_);
  for (const faults::DeviceCommand& command : commands)
    std::visit(Overloaded{[&](const faults::ResetProcessor&) {
                            resets_.push_back({origin_.ToBootTime(command.at_ns),
                                               origin_.ToBootTime(command.until_ns), command.fault});
                          },
                          [&](const faults::ResetByWatchdog&) { refuse(); },
                          [&](const faults::HangProcessor&) { refuse(); },
                          [&](const faults::StallProcessor&) { refuse(); },
                          [&](const faults::FlipBits&) { refuse(); },
                          // In force already, in task_delays_, slow_spans_ and clock_.
                          [](const faults::DelayTask&) {}, [](const faults::SlowProcessor&) {},
                          [](const faults::DriftClock&) {}, [](const faults::JumpClock&) {}},
               command.action);
  std::stable_sort(resets_.begin(), resets_.end(),
                   [](const Reset& a, const Reset& b) { return a.begin < b.begin; });
  // A wait by a clock that is wrong from now on ends at another time.
  if (wake_shown_) wake_ns_ = clock_.When(*wake_shown_);
  return Next();
}

std::optional<ClientStatus> CalledClient::Status() {
  LogAllOutput();
  return AskStatus();
}

ClientSample CalledClient::Sample() {
  const auto status = AskStatus();
  return {.supervisor_state = status ? std::optional(status->supervisor_state) : std::nullopt,
          .watched = {},
          .role = AskRole()};
}

void CalledClient::LogOutput(BootTime now) {
  logged_ns_ = now;
  TakeOutput(false);
}

void CalledClient::LogLine(const std::string& line) {
  report_.Look(line);
  host_.log(logged_ns_, line);
}

}  // namespace tiltproof::harness
