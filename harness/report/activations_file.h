// faults.jsonl: the kept activations of a flight's faults. Everything that reads the file does it here.
//
//   ReadActivations(ReadFlightFile(folder / "faults.jsonl"), ActivationBytes::kNone, [&](KeptActivation activation) {
//     Report(activation.what);
//     return true;  // go on
//   });
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

struct KeptChunk {
  TimeNs begin_ns;
  std::vector<std::uint8_t> bytes;
};

struct KeptActivation {
  TimeNs time_ns = 0;
  std::string fault, type;  // id and type of the fault
  std::string what;
  std::vector<KeptChunk> before, after;
};

// kNone: `before` and `after` stay empty. A line is then parsed in a fraction of the time.
enum class ActivationBytes : std::uint8_t { kNone, kAll };

// Calls `visit` for each activation, in the file's order, until it returns false. Throws std::runtime_error naming the
// line.
void ReadActivations(std::string_view jsonl, ActivationBytes bytes,
                     const std::function<bool(KeptActivation)>& visit);

}  // namespace tiltproof::harness
