#include "harness/dds/sequence_filter.h"

#include <iterator>
#include <limits>

namespace tiltproof::dds {

bool SequenceFilter::Pass(const std::string& run_id, const std::string& node_id, std::int64_t sequence) {
  if (sequence < 1 || sequence == std::numeric_limits<std::int64_t>::max()) return false;
  auto& ranges = logs_[{run_id, node_id}];
  const auto after = ranges.upper_bound(sequence);
  const auto before = after == ranges.begin() ? ranges.end() : std::prev(after);
  if (before != ranges.end() && before->second >= sequence) return false;

  const bool extends_before = before != ranges.end() && before->second == sequence - 1;
  const bool extends_after = after != ranges.end() && after->first - 1 == sequence;
  if (extends_before) {
    before->second = extends_after ? after->second : sequence;
    if (extends_after) ranges.erase(after);
  } else if (extends_after) {
    const auto last = after->second;
    ranges.erase(after);
    ranges[sequence] = last;
  } else {
    if (ranges.size() > kHolesCountMax) return false;
    ranges[sequence] = sequence;
  }
  return true;
}

std::int64_t SequenceFilter::CompleteUpTo(const std::string& run_id, const std::string& node_id) const {
  const auto log = logs_.find({run_id, node_id});
  if (log == logs_.end() || log->second.empty()) return 0;
  const auto& [first, last] = *log->second.begin();
  return first == 1 ? last : 0;
}

std::vector<SequenceGap> SequenceFilter::Gaps() const {
  std::vector<SequenceGap> gaps;
  for (const auto& [key, ranges] : logs_) {
    std::int64_t expected = 1;
    for (const auto& [first, last] : ranges) {
      if (first > expected) gaps.push_back({key.first, key.second, expected, first - 1});
      expected = last + 1;
    }
  }
  return gaps;
}

}  // namespace tiltproof::dds
