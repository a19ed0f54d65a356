// The result of one flight, without a file: what reports, comparisons and campaigns work with.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/client/coverage.h"
#include "harness/client/firmware_end.h"
#include "harness/score/outcome.h"
#include "harness/score/score.h"
#include "link/fields.h"

namespace tiltproof::harness {

// A RunEvent as files hold it: in seconds, with its client by name.
struct FlightEvent {
  double time_s = 0.0;
  std::string kind;
  std::optional<std::string> client;  // none: the flight's, or that of the only client
  std::string text;
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(time_s, kind, client, text)
};

// A StackUse as files hold it: with its client by name.
struct FlightStack {
  std::optional<std::string> client;  // none: the only one
  std::string name;
  std::int64_t size_bytes = 0;
  std::int64_t used_bytes_max = 0;
  bool overflowed = false;
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(client, name, size_bytes, used_bytes_max, overflowed)
};

struct FlightResult {
  std::string name;  // unique in its run
  Verdict expected = Verdict::kPass;
  std::uint64_t seed = 0;
  std::string trace_hash;                   // empty: there was no flight to score
  std::optional<EndReason> end_reason;      // none: there was no flight to score
  std::optional<Outcome> outcome;           // none: read from a file of an older version
  std::optional<FirmwareEnd> firmware_end;  // none: the firmware did not break, or it is not known how
  double wall_s = 0.0;
  double real_time_factor = 0.0;
  Score score;
  // Blocks of the chip that a firmware uses and the emulated board does not model.
  std::vector<std::string> unmodelled_blocks;
  std::vector<FlightStack> stacks;  // of images on the emulated board, in lockstep
  std::vector<FlightEvent> events;
  // The last lines that a firmware printed before it went away.
  std::vector<std::string> last_lines;
  bool is_of_any_seed = false;  // nothing was drawn at random: with another seed, this is the same flight
  std::string replay;           // the exact command; empty when it was not flown
  // Coverage of the only client (harness/client/coverage.h), when the job asks for it.
  CoverageKind coverage_kind = CoverageKind::kBlackBox;
  std::vector<std::uint32_t> coverage;

  bool green() const { return score.verdict == expected; }
  // In files the fields of the score stand among these, and the events in events.jsonl.
  static constexpr std::array<std::string_view, 6> kNotInFiles = {
      "score", "events", "last_lines", "is_of_any_seed", "coverage_kind", "coverage"};
  TILTPROOF_FIELDS(name, expected, seed, trace_hash, end_reason, outcome, firmware_end, wall_s,
                   real_time_factor, score, unmodelled_blocks, stacks, events, last_lines, is_of_any_seed,
                   replay, coverage_kind, coverage)
};

// Scores a flight.
FlightResult MakeResult(const std::string& name, const Scenario& scenario, const RunLog& log,
                        const std::string& replay);
// For a scenario that left no flight to score.
FlightResult MakeErrorResult(const std::string& name, const Scenario& scenario, const std::string& reason,
                             const std::string& replay);

std::vector<FlightEvent> EventsOf(const RunLog& log);
// Possible causes of a failure beside what decided the verdict: one line for each.
std::vector<std::string> OtherCauses(const FlightResult& result);

// From one process of this build to another, to the bit.
std::vector<std::uint8_t> Pack(const FlightResult& result);
// Throws std::runtime_error on bytes that are no result.
FlightResult UnpackFlightResult(std::span<const std::uint8_t> bytes);

}  // namespace tiltproof::harness
