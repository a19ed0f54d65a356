// Counts the activations of every fault and keeps the first of each for the log.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "faults/fault.h"

namespace tiltproof::faults {

// Activations of one fault that are kept whole; later ones are only counted.
inline constexpr std::int64_t kActivationsMax = 1000;

class Recorder {
 public:
  explicit Recorder(std::size_t fault_count) : counts_(fault_count, 0) {}

  bool Keeps(std::size_t fault) const { return counts_[fault] < kActivationsMax; }
  // Counts one. `make` gives the record and is called only if it is kept; `in_line_time`: its times are those
  // of the line (boot time), not simulation time.
  template <class Make>
  void Count(std::size_t fault, bool in_line_time, Make&& make) {
    if (Keeps(fault)) kept_.push_back({make(), in_line_time});
    ++counts_[fault];
  }

  const std::vector<std::int64_t>& counts() const { return counts_; }
  // What was kept, in order of time, all in simulation time; `origin_ns` is the boot time of t = 0.
  std::vector<Activation> Take(TimeNs origin_ns);

 private:
  struct Kept {
    Activation activation;
    bool in_line_time;
  };
  std::vector<std::int64_t> counts_;
  std::vector<Kept> kept_;
};

}  // namespace tiltproof::faults
