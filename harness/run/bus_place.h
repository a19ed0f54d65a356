// Where a flight is on the bus, for its own processes and for observers.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "harness/run/run_log.h"
#include "link/fields.h"

namespace tiltproof::harness {

struct BusPlace {
  int domain = 0;      // of DDS
  std::string tag;     // nodes with another tag on that domain neither see nor hear the flight
  std::string run_id;  // in each of its messages
  TILTPROOF_FIELDS(domain, tag, run_id)
  bool operator==(const BusPlace&) const = default;
};

// Where a monitor listens, and what a person who waits for a flight there should know.
struct WatchTarget {
  std::optional<BusPlace> place;  // none: not on the bus yet
  std::string text;
  bool operator==(const WatchTarget&) const = default;
};
// Asked now and then: a run's next flight is in another place.
using FindWatchTarget = std::function<WatchTarget()>;

// As the flight's first event, of the kind "bus".
void TellPlace(RunLog& log, const BusPlace& place);

}  // namespace tiltproof::harness
