// The results of a run: one entry per scenario, gathered in results.json, junit.xml and run.json.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "harness/engine/flight_result.h"
#include "harness/report/machine.h"
#include "harness/report/trace_file.h"
#include "harness/run/bus_place.h"
#include "link/fields.h"

namespace tiltproof::harness {

std::string_view Version();

// One flight of a run, before it is flown.
struct PlannedFlight {
  std::string name;
  Verdict expected = Verdict::kPass;
  std::uint64_t seed = 0;
  std::optional<BusPlace> bus{};  // once it is there, for observers
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(name, expected, seed, bus)
};
// Its result until it has another one: an error with this reason.
inline constexpr const char* kNotFlown = "not flown to the end: the run ended before, or is still under way";
FlightResult NotFlown(const PlannedFlight& flight, const std::string& reason = kNotFlown);

// The JSON text of one entry (verdict.json), and back; throws std::runtime_error.
std::string ToJsonText(const FlightResult& result);
FlightResult ResultFromJsonText(const std::string& text);

// A scenario that cannot be flown with the run's client or in its mode.
struct NotApplicable {
  std::string name;
  std::string reason;  // of each problem, with its place
  std::string why{};   // of the first problem, without its place: the same for all scenarios that have it
  static constexpr std::array<std::string_view, 1> kNotInFiles = {"why"};
  TILTPROOF_FIELDS(name, reason, why)
};

// The flights for which a run keeps a folder.
enum class Keep : std::uint8_t { kAll, kFailing, kVerdicts };
std::string_view Name(Keep keep);
constexpr Keep LastOf(Keep) { return Keep::kVerdicts; }

struct RunInfo {
  std::string suite;
  std::string started;  // ISO 8601 UTC
  std::string version{Version()};
  std::uint64_t seed = 0;
  std::string mode = "lockstep";               // or "realtime"
  std::string client;                          // --client as given
  std::map<std::string, std::string> clients;  // by id, those of --client ID=...
  Machine machine;
  std::optional<std::string> build;  // harness/report/build_id.h; none in the files of older versions
  std::vector<std::string> command;
  bool interrupted = false;                   // by a signal, or killed: unfinished
  std::vector<PlannedFlight> flights;         // in the order of the results
  std::vector<NotApplicable> not_applicable;  // found in a folder, and left out
  Keep keep = Keep::kAll;
  std::optional<TraceFormat> trace;  // none in the files of older versions
  std::string realtime_rights;       // in real time: the scheduling and memory that the nodes got
  TILTPROOF_FIELDS(suite, started, version, build, machine, seed, mode, client, clients, command, interrupted,
                   keep, trace, flights, not_applicable, realtime_rights)
};

// run.json: what is needed to do the run again, and to listen to it. Written before the first flight, and again
// when a flight goes on the bus.
void WriteRunInfo(const std::filesystem::path& folder, const RunInfo& info);
RunInfo ReadRunInfo(const std::filesystem::path& folder);

// results.json and junit.xml, with what is not applicable as `info` has it.
void WriteResults(const std::filesystem::path& folder, const RunInfo& info,
                  const std::vector<FlightResult>& results);

// The entries of results.json. Throws FileError, or std::runtime_error naming the file.
std::vector<FlightResult> ReadResults(const std::filesystem::path& folder);

// Exit code of a set of results: 3 harness or target error, 1 not green by pass or fail, 4 unexpectedly
// inconclusive, 0 all green.
int ExitCode(const std::vector<FlightResult>& results);

}  // namespace tiltproof::harness
