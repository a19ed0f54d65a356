// A flight to be flown, and by what means.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "harness/client/debugger.h"
#include "harness/engine/flight_result.h"
#include "harness/engine/forked_futures.h"
#include "harness/run/future.h"
#include "harness/run/realtime/injection.h"
#include "harness/run/record.h"
#include "harness/run/remote/distributed_flight.h"
#include "harness/run/steered_flight.h"
#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// Means to fly the flights of a run.
struct FlightMeans {
  RunClients clients;
  bool realtime = false;
  std::optional<Transport> distributed;  // lockstep with every part in a process of its own
  bool attach = false;                   // realtime: with nodes that run already
  int domain = 0;                        // 0: the first free one
  std::string interface;
  std::vector<std::string> peers;
  std::optional<DebugStop> debug;
  std::string program;  // this program, which the parts of a flight in several processes run

  // The specs of a scenario's clients, in its order.
  std::vector<ClientSpec> ClientsOf(const Scenario& scenario) const;
  // True if a worker process has the firmware in it.
  bool FirmwareInWorker(const Scenario& scenario) const;
  // True if its worker process may fly other flights before and after it. A flight leaves nothing behind in the shipped
  // firmware. It may leave anything in the static variables of a user's library.
  bool SharesWorker(const Scenario& scenario) const;
  // As run.json keeps it.
  std::string client_text() const { return attach ? "attached" : ToText(clients.all); }
};

// Writes a flight to the disk. Both functions run in its worker process, and may throw: then its result is an error. Without
// `end` nothing reads the flight's activations, and only their counts are kept.
struct FlightRecorder {
  std::function<void(const Scenario&)> begin = {};                                    // before it
  std::function<void(const Scenario&, const RunLog&, const FlightResult&)> end = {};  // after it
};

// The flight departs from a trunk (harness/engine/trunk.h). Flights of one trunk are equal but for their names, and for this
// fault's parameters and the end of its window.
struct Departure {
  std::string trunk;      // its name, among the trunks of an engine
  std::size_t fault = 0;  // its place in the scenario
};

struct FlightJob {
  std::string name;  // unique among the flights of an engine
  Scenario scenario;
  std::shared_ptr<const plant::VehicleModel> model;
  FlightMeans means;
  std::string replay;  // the exact command that flies it again
  FlightRecorder recorder{};
  // True if its result lists the code of the firmware that it has executed.
  bool coverage = false;
  // True if its result reports the firmware's end after the flight: kEndFailedEvent, if that went wrong.
  bool tells_end = false;
  // Called in its worker process when it begins: makes what gets the flight's records as they are made.
  std::function<std::unique_ptr<RecordSink>()> observe = {};
  // The faults that a user injects into a flight in real time; none: injection is off.
  std::function<Injections()> injections = {};
  // Steers it, in its worker process, in lockstep: called at power-on and at each row, with the scenario as
  // it was flown so far. While it waits, it calls `alive` now and then.
  std::function<void(SteeredFlight& flight, Scenario& flown, const std::function<void()>& alive)> steer = {};
  // It is this future of the scenario's flight. In lockstep, in one process.
  std::optional<Future> future = {};
  // Futures that are flown beside it, of a library in lockstep.
  std::optional<FutureForks> forks = {};
  // It may depart from a trunk. Its result is the same.
  std::optional<Departure> departure = {};
};

FlightResult ErrorResult(const FlightJob& job, const std::string& reason);

// The event of a result that is an error since its process failed outside the calls into the library that it flew, in a
// way in which memory may be noticed that the library has damaged: it died of a signal as a crash sends, ran out of
// memory, or stood still.
inline constexpr std::string_view kFailedOutsideCallsEvent = "process_failed";
// Such a result when the firmware was in that process, and that of an error of ours when it was not.
FlightResult FailedOutsideCalls(const FlightJob& job, const std::string& what, TimeNs reached_ns);
// The event of a result that is an error since a signal ended its process which others send, too, in a call into the firmware
// or not: which signal, and where.
inline constexpr std::string_view kEndedBySignalEvent = "ended_by_signal";
// The event of a flight, which counts as it was, whose firmware did not end in order after it: how.
inline constexpr std::string_view kEndFailedEvent = "end_failed";
// The event of a result that was lost with its process: when.
inline constexpr std::string_view kLostEvent = "process_lost";

}  // namespace tiltproof::harness
