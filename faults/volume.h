// Finds faults that are certain to make more of a frame than a line can hold, before anything is flown.
//
//   if (const auto too_much = CertainOverfull(scenario.faults, scenario.duration_ns, *scenario.link.protocol)) Refuse(*too_much);
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "faults/fault.h"
#include "link/chunk.h"
#include "link/protocol.h"

namespace tiltproof::faults {

// The faults, in the order in which they act; the last one exceeds the limit.
struct TooMuch {
  link::Direction direction{};
  std::vector<std::size_t> faults;
};

// True if a valid fault doubles the bytes of every frame that it sees.
bool DoublesBytes(const FaultSpec& spec);

// Counts only what is certain: faults that double the bytes of every frame they see (WireKind::volume),
// active together for at least two control periods, without another fault that may lose bytes. Valid faults
// only.
std::optional<TooMuch> CertainOverfull(const std::vector<FaultSpec>& specs, TimeNs duration_ns,
                                       const link::Protocol& protocol);

}  // namespace tiltproof::faults
