// Where `tiltproof node monitor` listens: at a domain and a tag, or at the flights of a run, which its run.json tells.
//
//   const FindPost post = PostOfRun("results/latest");
//   const ListeningPost now = post();  ...  // again: the next flight, or the next run that is `latest`
#pragma once

#include <filesystem>

#include "harness/run/bus_place.h"

namespace tiltproof::harness {

FindPost PostAt(const BusPlace& place);
// Throws UsageError when there is no run.
FindPost PostOfRun(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
