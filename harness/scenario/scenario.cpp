#include "harness/scenario/scenario.h"

#include "faults/registry.h"

namespace tiltproof::harness {

std::string_view Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kInconclusive:
      return "inconclusive";
    case Verdict::kFail:
      return "fail";
    case Verdict::kError:
      return "error";
  }
  return "unknown";
}

std::string_view Name(AngularRates rates) {
  switch (rates) {
    case AngularRates::kWorld:
      return "world";
    case AngularRates::kBody:
      return "body";
    case AngularRates::kEuler:
      return "euler";
  }
  return "unknown";
}

std::optional<std::string> NeedsRealtime(const Scenario& scenario) {
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const faults::FaultSpec& fault = scenario.faults[i];
    const faults::FaultType* type = faults::FindFaultType(fault.type);
    if (type == nullptr || !type->on_node) continue;
    const std::string place = i < scenario.fault_places.size() ? scenario.fault_places[i] + ": " : "";
    return place + "fault '" + fault.id + "' (" + fault.type +
           ") acts on a node, which in lockstep is no process: it needs --mode realtime";
  }
  return std::nullopt;
}

}  // namespace tiltproof::harness
