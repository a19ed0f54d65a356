// The flag --over of `tiltproof search`: KEY=A..B for numbers, KEY=V1,V2,... for names.
#pragma once

#include <string>

#include "harness/campaign/search_space.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// Throws UsageError that names the flag, the key or value that is wrong, and the nearest right one.
SearchedNumber ReadOver(const std::string& text, const Scenario& scenario, const VehicleSignals& signals);

}  // namespace tiltproof::harness
