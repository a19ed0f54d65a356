#include "faults/recorder.h"

#include <algorithm>

namespace tiltproof::faults {

namespace {

std::vector<link::LogChunk> Shifted(std::vector<link::Chunk>&& chunks, Origin origin) {
  std::vector<link::LogChunk> shifted;
  shifted.reserve(chunks.size());
  for (link::Chunk& chunk : chunks)
    shifted.push_back(
        {origin.SimulationTime(chunk.begin_ns), std::move(chunk.bytes), chunk.message, chunk.number});
  return shifted;
}

Activation Shifted(BootActivation&& activation, Origin origin) {
  return {.time_ns = origin.SimulationTime(activation.time_ns),
          .fault = activation.fault,
          .what = std::move(activation.what),
          .before = Shifted(std::move(activation.before), origin),
          .after = Shifted(std::move(activation.after), origin)};
}

}  // namespace

std::vector<Activation> Recorder::Take(Origin origin) {
  const Origin of_log = origin.OrPowerOn();
  std::vector<Activation> activations;
  activations.reserve(kept_.size());
  for (auto& kept : kept_) {
    if (auto* of_line = std::get_if<BootActivation>(&kept)) {
      activations.push_back(Shifted(std::move(*of_line), of_log));
    } else {
      activations.push_back(std::get<Activation>(std::move(kept)));
    }
  }
  kept_.clear();
  std::stable_sort(activations.begin(), activations.end(),
                   [](const Activation& a, const Activation& b) { return a.time_ns < b.time_ns; });
  return activations;
}

}  // namespace tiltproof::faults
