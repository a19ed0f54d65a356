// Where a flight is on the bus, for its own processes and for whoever listens to it.
#pragma once

#include <string>

#include "harness/run/run_log.h"

namespace tiltproof::harness {

struct BusPlace {
  int domain = 0;      // of DDS
  std::string tag;     // who has another one on that domain neither sees nor hears the flight
  std::string run_id;  // in each of its messages
};

// As the flight's first event, of the kind "bus".
void TellPlace(RunLog& log, const BusPlace& place);

}  // namespace tiltproof::harness
