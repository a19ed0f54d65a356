#include "faults/recorder.h"

#include <algorithm>

namespace tiltproof::faults {

std::vector<Activation> Recorder::Take(TimeNs origin_ns) {
  std::vector<Activation> activations;
  activations.reserve(kept_.size());
  for (Kept& kept : kept_) {
    if (kept.in_line_time) {
      kept.activation.time_ns -= origin_ns;
      for (link::Chunk& chunk : kept.activation.before) chunk.begin_ns -= origin_ns;
      for (link::Chunk& chunk : kept.activation.after) chunk.begin_ns -= origin_ns;
    }
    activations.push_back(std::move(kept.activation));
  }
  kept_.clear();
  std::stable_sort(activations.begin(), activations.end(),
                   [](const Activation& a, const Activation& b) { return a.time_ns < b.time_ns; });
  return activations;
}

}  // namespace tiltproof::faults
