#include "harness/engine/flight_job.h"

namespace tiltproof::harness {

std::vector<ClientSpec> FlightMeans::ClientsOf(const Scenario& scenario) const {
  std::vector<ClientSpec> specs;
  for (std::size_t i = 0; i < scenario.client_count(); ++i)
    specs.push_back(clients.Of(scenario.client_id(i)));
  return specs;
}

bool FlightMeans::FirmwareInWorker(const Scenario& scenario) const {
  return !realtime && !distributed && !scenario.has_several_clients() &&
         AbilitiesOf(ClientsOf(scenario).front(), realtime).guarded;
}

bool FlightMeans::SharesWorker(const Scenario& scenario) const {
  return FirmwareInWorker(scenario) && AbilitiesOf(ClientsOf(scenario).front(), realtime).shipped;
}

FlightResult ErrorResult(const FlightJob& job, const std::string& reason) {
  return MakeErrorResult(job.name, job.scenario, reason, job.replay);
}

FlightResult FailedOutsideCalls(const FlightJob& job, const std::string& what, TimeNs reached_ns) {
  if (!job.means.FirmwareInWorker(job.scenario)) return ErrorResult(job, what);
  FlightResult result = ErrorResult(
      job, what +
               ", outside the firmware's calls: memory that the firmware damaged before may be the "
               "cause; -fsanitize=address shows where");
  result.events.push_back({ToSeconds(reached_ns), std::string(kFailedOutsideCallsEvent), std::nullopt, what});
  return result;
}

}  // namespace tiltproof::harness
