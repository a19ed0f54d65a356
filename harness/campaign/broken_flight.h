// Finds what hostile bytes broke in a flight, if anything, and compares the ways in which two flights broke.
//
//   if (const auto broken = BrokenBy(result)) findings.try_emplace(broken->key, *broken);
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "harness/engine/flight_result.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

struct BrokenFlight {
  // "crash", "hang", "restart", "command", "silence", "ignored", "stale": the name of a finding begins with it.
  std::string kind;
  std::string key;     // the same for flights that broke in the same way
  std::string reason;  // one line
  // The reason that the same flight may pass while the defect is there, as a sentence; empty: it fails again.
  std::string may_pass;
  // The name of a finding, from its key: "crash-3f2a91bc".
  std::string Name() const;
};

// The criteria that a flight of a campaign has: the oracles beside those that every flight has.
std::vector<CriterionSpec> FuzzCriteria(const link::Protocol& protocol);
// True where a firmware may break the criterion by design, and a busy machine in real time.
bool DependsOnDesign(const CriterionSpec& criterion);
// The reason that breaking the criterion is no finding, as a sentence: the firmware did so in WellFormedFlight(), where
// no frame is broken. None: it is one.
std::optional<std::string> WhyByDesign(const CriterionSpec& criterion, const FlightResult& well_formed);

// The break in a flight with these criteria. A vehicle that is lost says nothing about the reader of frames.
std::optional<BrokenFlight> BrokenBy(const FlightResult& result);

// Break in a flight whose process failed outside the firmware's calls, or was ended by a signal that others send, too.
// The harness's own fault or a user's wish may cause that. So it counts when it is seen again, and a flight without
// hostile bytes is green. None: it died before it heard any.
std::optional<BrokenFlight> BrokenOutsideCalls(const FlightResult& result, const link::Protocol& protocol);

// A reason without what differs from flight to flight: times, addresses, numbers. `with_places`: but with lines of a source
// and offsets in a library.
std::string KeyOfReason(const std::string& reason, bool with_places = false);

}  // namespace tiltproof::harness
