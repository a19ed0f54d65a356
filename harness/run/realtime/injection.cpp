#include "harness/run/realtime/injection.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

// From a wish to the control step at which it begins: time to tell the nodes.
constexpr TimeNs kLeadNs = 40 * kNsPerMs;

}  // namespace

std::optional<RunEvent> Injector::Poll(Scenario& scenario, bool running, TimeNs now_ns, const Tell& tell) {
  if (injections_ == nullptr) return std::nullopt;
  const auto text = injections_->next();
  if (!text) return std::nullopt;
  Injections::Answer answer;
  std::optional<RunEvent> event;
  try {
    if (!running) throw std::runtime_error("the flight has not begun yet");
    if (text->size() > kInjectedBytesMax)
      throw std::runtime_error(fmt::format("expected a fault of at most {} bytes", kInjectedBytesMax));
    const TimeNs period_ns = scenario.link.protocol->control_period_ns;
    const TimeNs wanted_ns = (now_ns + kLeadNs + period_ns - 1) / period_ns * period_ns;
    AddedFault fault{.text = *text, .id = fmt::format("injected-{}", count_ + 1), .start_ns = wanted_ns};
    const auto add = [&] {
      answer.fault = injections_->add(scenario, fault).faults.back();
      if (fault.start_ns >= scenario.duration_ns) throw std::runtime_error("the flight is over");
    };
    add();
    for (const TimeNs begin_ns : tell(fault)) fault.start_ns = std::max(fault.start_ns, begin_ns);
    const bool is_late = fault.start_ns > wanted_ns;
    if (is_late) add();
    scenario.faults.push_back(answer.fault);
    answer.accepted = true;
    ++count_;
    event = {
        fault.start_ns, "fault_injected",
        fmt::format(
            "'{}' ({}) from {:.3f} s on{}", answer.fault.id, answer.fault.type, ToSeconds(fault.start_ns),
            is_late ? fmt::format("; its node received it too late for {:.3f} s", ToSeconds(wanted_ns))
                    : "")};
  } catch (const std::exception& error) {
    answer.text = error.what();
  }
  injections_->answer(answer);
  return event;
}

TimeNs KeptBegin(const Scenario& scenario, TimeNs wanted_ns, TimeNs done_until_ns) {
  const TimeNs period_ns = scenario.link.protocol->control_period_ns;
  return std::max(wanted_ns, (done_until_ns / period_ns + 1) * period_ns);
}

}  // namespace tiltproof::harness
