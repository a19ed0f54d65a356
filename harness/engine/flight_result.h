// The result of one flight, without a file: what reports, comparisons and campaigns work with.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/score/outcome.h"
#include "harness/score/score.h"

namespace tiltproof::harness {

// A RunEvent with its client by name.
struct FlightEvent {
  TimeNs time_ns = 0;
  std::string kind;
  std::string client;  // empty: the flight's, or that of the only client
  std::string text;
};

struct FlightResult {
  std::string name;  // unique in its run
  Verdict expected = Verdict::kPass;
  std::uint64_t seed = 0;
  std::string trace_hash;               // empty: there was no flight to score
  std::optional<EndReason> end_reason;  // none: there was no flight to score
  std::optional<Outcome> outcome;       // none: read from a file of an older version
  double wall_s = 0.0;
  double real_time_factor = 0.0;
  Score score;
  std::vector<FlightEvent> events;
  std::string replay;  // the exact command; empty when it was not flown

  bool green() const { return score.verdict == expected; }
};

// Scores a flight.
FlightResult MakeResult(const std::string& name, const Scenario& scenario, const RunLog& log,
                        const std::string& replay);
// For a scenario that left no flight to score.
FlightResult MakeErrorResult(const std::string& name, const Scenario& scenario, const std::string& reason,
                             const std::string& replay);

std::vector<FlightEvent> EventsOf(const RunLog& log);

// From one process of this build to another, to the bit.
std::vector<std::uint8_t> Pack(const FlightResult& result);
// Throws std::runtime_error on bytes that are no result.
FlightResult UnpackFlightResult(std::span<const std::uint8_t> bytes);

}  // namespace tiltproof::harness
