#include "harness/score/client_behaviour.h"

#include <algorithm>

#include "faults/registry.h"
#include "harness/run/late_periods.h"

namespace tiltproof::harness {
namespace {

// In real time, the report of a restart may have a time that is some periods old.
constexpr TimeNs kStaleMax = 50 * kNsPerMs;

// True if a fault acts on the client: one on its device, or one on nodes that include the client's.
bool ActsOnClient(const faults::FaultSpec& spec, const faults::FaultType& type) {
  if (type.IsOneOf<faults::DeviceKind>()) return true;
  if (!type.IsOneOf<faults::NodeKind, faults::ClockKind>()) return false;
  const std::string node = faults::ResolvedParameters(spec, type).Choice("node");
  return node == "client" || node == "all";
}

}  // namespace

std::vector<faults::FaultSpec> FaultsOn(const Scenario& scenario, std::size_t client) {
  std::vector<faults::FaultSpec> faults = scenario.faults;
  std::erase_if(faults, [&](const faults::FaultSpec& fault) {
    // One on a line between boards leaves the client's own lines whole.
    return !fault.line.empty() || (!fault.client.empty() && fault.client != scenario.client_id(client));
  });
  return faults;
}

std::string Whose(const Scenario& scenario, std::size_t client) {
  return scenario.has_several_clients() ? "client " + scenario.client_id(client) + " " : "";
}

const std::vector<TimeNs>& PeriodTimes(const Scenario& scenario, const ClientLog& log) {
  return scenario.link.protocol->streams() ? log.actuator_times_ns : log.request_times_ns;
}

std::vector<Restart> UnaskedRestarts(const std::vector<faults::FaultSpec>& faults,
                                     std::span<const Restart> restarts) {
  std::vector<TimeNs> asked_ns;
  for (const auto& spec : faults) {
    const faults::FaultType* type = faults::FindFaultType(spec.type);
    if (type != nullptr && type->asks_restart() && ActsOnClient(spec, *type))
      asked_ns.push_back(spec.start_ns);
  }
  std::sort(asked_ns.begin(), asked_ns.end());
  std::size_t answered = 0;
  std::vector<Restart> unasked;
  for (const Restart& restart : restarts) {
    if (answered == asked_ns.size() || restart.time_ns + kStaleMax < asked_ns[answered])
      unasked.push_back(restart);
    else
      ++answered;
  }
  return unasked;
}

bool FollowsLateness(const Restart& restart, std::span<const LateSpan> late) {
  return std::any_of(late.begin(), late.end(), [&](const LateSpan& span) {
    return span.begin_ns <= restart.time_ns + kStaleMax && span.end_ns + kLatenessReach >= restart.time_ns;
  });
}

RequestIntervals UndisturbedIntervals(const std::vector<faults::FaultSpec>& faults,
                                      std::span<const LateSpan> disturbed,
                                      std::span<const TimeNs> request_times_ns) {
  std::vector<faults::Window> windows;
  for (const auto& spec : faults) {
    const faults::FaultType* type = faults::FindFaultType(spec.type);
    if (type != nullptr && ActsOnClient(spec, *type)) windows.push_back(faults::WindowOf(spec));
  }
  RequestIntervals intervals;
  std::size_t begun = 0;  // of `disturbed`
  TimeNs disturbed_until_ns = -kNever;
  for (std::size_t i = 1; i < request_times_ns.size(); ++i) {
    const TimeNs begin_ns = request_times_ns[i - 1], end_ns = request_times_ns[i];
    for (; begun < disturbed.size() && disturbed[begun].begin_ns <= end_ns; ++begun)
      disturbed_until_ns = std::max(disturbed_until_ns, disturbed[begun].end_ns);
    const bool in_fault = std::any_of(windows.begin(), windows.end(), [&](const faults::Window& window) {
      return window.begin_ns <= end_ns && begin_ns < window.end_ns;
    });
    if (in_fault) continue;
    if (disturbed_until_ns >= begin_ns) {
      ++intervals.disturbed_count;
    } else {
      intervals.ns.push_back(end_ns - begin_ns);
    }
  }
  std::sort(intervals.ns.begin(), intervals.ns.end());
  return intervals;
}

}  // namespace tiltproof::harness
