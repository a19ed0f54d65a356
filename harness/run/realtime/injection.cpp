#include "harness/run/realtime/injection.h"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

// From a wish to the control step at which it begins: time to tell the nodes.
constexpr TimeNs kLeadNs = 40 * kNsPerMs;

}  // namespace

std::optional<std::string> Injector::Turn(
    Scenario& scenario, bool running, TimeNs now_ns,
    const std::function<void(const std::vector<dds::Port>& ports)>& tell) {
  if (injections_ == nullptr) return std::nullopt;
  const auto text = injections_->next();
  if (!text) return std::nullopt;
  Injections::Answer answer;
  std::optional<std::string> done;
  try {
    if (!running) throw std::runtime_error("the flight has not begun yet");
    if (text->size() > kInjectedBytesMax)
      throw std::runtime_error(fmt::format("expected a fault of at most {} bytes", kInjectedBytesMax));
    const TimeNs period_ns = scenario.link.protocol->control_period_ns;
    const AddedFault fault{.text = *text,
                           .id = fmt::format("injected-{}", count_ + 1),
                           .start_ns = (now_ns + kLeadNs + period_ns - 1) / period_ns * period_ns};
    answer.fault = injections_->add(scenario, fault).faults.back();
    if (fault.start_ns >= scenario.duration_ns) throw std::runtime_error("the flight is over");
    tell({{"fault", fault.text}, {"id", fault.id}, {"start_ns", std::to_string(fault.start_ns)}});
    scenario.faults.push_back(answer.fault);
    answer.accepted = true;
    ++count_;
    done = fmt::format("'{}' ({}) from {:.3f} s on", answer.fault.id, answer.fault.type,
                       ToSeconds(fault.start_ns));
  } catch (const std::exception& error) {
    answer.text = error.what();
  }
  injections_->answer(answer);
  return done;
}

AddedFault FromPorts(const std::vector<dds::Port>& ports) {
  AddedFault fault;
  for (const dds::Port& port : ports) {
    if (port.name == "fault") fault.text = port.path;
    if (port.name == "id") fault.id = port.path;
    if (port.name == "start_ns")
      std::from_chars(port.path.data(), port.path.data() + port.path.size(), fault.start_ns);
  }
  return fault;
}

}  // namespace tiltproof::harness
