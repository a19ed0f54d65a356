// Where `tiltproof node monitor` listens: at a domain and a tag, or at the flights of a run, which its run.json tells.
//
//   const FindWatchTarget target = WatchTargetOfRun("results/latest");
//   const WatchTarget now = target();  ...  // again: the next flight, or the next run that is `latest`
#pragma once

#include <filesystem>

#include "harness/run/bus_place.h"

namespace tiltproof::harness {

FindWatchTarget WatchTargetAt(const BusPlace& place);
// Throws UsageError when there is no run.
FindWatchTarget WatchTargetOfRun(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
