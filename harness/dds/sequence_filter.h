// Tracks the messages of a log: those that came, and those that did not.
//
// A log's messages are numbered 1, 2, 3 ... per (run_id, node_id). DDS delivers each at least once: after a
// long cut of the network a writer repeats its history. The filter lets each number pass once and knows
// the holes.
//
//   SequenceFilter filter;
//   if (filter.Pass("run", "plant", message.sequence)) Keep(message);
//   filter.CompleteUpTo("run", "plant");
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "harness/dds/bus.h"

namespace tiltproof::dds {

class SequenceFilter {
 public:
  // Beyond so many holes in one log, what would open another is refused - and so remains a hole.
  static constexpr std::size_t kHolesCountMax = 4096;

  // False for a number that came before, and for one below 1.
  bool Pass(const std::string& run_id, const std::string& node_id, std::int64_t sequence);
  std::int64_t CompleteUpTo(const std::string& run_id, const std::string& node_id) const;
  std::vector<SequenceGap> Gaps() const;

 private:
  using Ranges = std::map<std::int64_t, std::int64_t>;  // first -> last, disjoint and not adjacent
  std::map<std::pair<std::string, std::string>, Ranges> logs_;
};

}  // namespace tiltproof::dds
