// The two forms of a scenario's `model`, and of MODEL on the command line.
#pragma once

#include <string_view>

namespace tiltproof::harness {

// True of a path to a vehicle's file, false of the name of a shipped vehicle. A path to a file of another format counts,
// because its reader reports how to convert it.
inline bool IsModelPath(std::string_view model) {
  return model.find_first_of("./") != std::string_view::npos;
}

}  // namespace tiltproof::harness
