// Counts the activations of every fault and keeps the first of each for the log.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "faults/fault.h"
#include "link/check.h"

namespace tiltproof::faults {

// Number of activations per fault that are kept whole; later ones are only counted.
inline constexpr std::int64_t kActivationsMax = 1000;
// An activation whose chunks have a greater total weight (link::WeightOf()) than this is only counted, too. So
// is one that exceeds the fault's share of the second limit, which is for all faults together.
inline constexpr std::size_t kActivationBytesMax = std::size_t{64} << 10;
inline constexpr std::size_t kActivationsBytesMax = std::size_t{32} << 20;

class Recorder {
 public:
  // `keeps`: false where nothing reads the records.
  explicit Recorder(std::size_t fault_count, bool keeps = true)
      : keeps_(keeps), counts_(fault_count, 0), bytes_(fault_count, 0) {}

  // One fault more.
  void Grow() {
    counts_.push_back(0);
    bytes_.push_back(0);
  }
  bool Keeps(std::size_t fault) const {
    CheckIndex(fault, counts_.size(), "an activation belongs to a known fault");
    return keeps_ && counts_[fault] < kActivationsMax;
  }
  // Counts one activation of that many bytes. `make` returns the record, an Activation or a BootActivation,
  // and is called only if the record is kept, or is the fault's first.
  template <class Make>
  void Count(std::size_t fault, std::size_t bytes, Make&& make) {
    const bool keeps = Keeps(fault) && bytes <= kActivationBytesMax &&
                       bytes_[fault] + bytes <= kActivationsBytesMax / counts_.size();
    if (keeps || counts_[fault] == 0) {
      auto record = make();
      if (counts_[fault] == 0) firsts_.push_back({fault, record.time_ns});
      if (keeps) {
        kept_.push_back(std::move(record));
        bytes_[fault] += bytes;
      }
    }
    ++counts_[fault];
  }
  // The same for a record without chunks.
  template <class Make>
  void Count(std::size_t fault, Make&& make) {
    Count(fault, std::size_t{0}, std::forward<Make>(make));
  }

  struct First {
    std::size_t fault;
    std::variant<BootTime, TimeNs> time_ns;
  };
  // The first activation of each fault that acted since the last call.
  std::vector<First> TakeFirsts() { return std::exchange(firsts_, {}); }

  const std::vector<std::int64_t>& counts() const { return counts_; }
  // The kept records, in order of time, all in simulation time. Without t = 0, the times of a line's records
  // count from power-on.
  std::vector<Activation> Take(Origin origin);

 private:
  bool keeps_;
  std::vector<std::int64_t> counts_;
  std::vector<std::size_t> bytes_;  // of what was kept
  std::vector<std::variant<BootActivation, Activation>> kept_;
  std::vector<First> firsts_;
};

}  // namespace tiltproof::faults
