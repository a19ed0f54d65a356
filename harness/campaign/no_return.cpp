#include "harness/campaign/no_return.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "harness/report/repeats.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr std::int64_t kCoarseIntervals = 10;
// A change of the chance that is looked at closely, down to a fraction of the coarse grid.
constexpr double kMuchChange = 0.15;
constexpr std::int64_t kCloserBy = 8;

// The futures of each moment, by its number of steps from the begin.
using Known = std::map<std::int64_t, FutureCount>;

double ChanceOf(const FutureCount& count) {
  return static_cast<double>(count.fails) / static_cast<double>(count.futures);
}
bool IsLost(const FutureCount& count) { return 2 * count.fails >= count.futures; }

// Middles of the intervals between known moments that are to be halved, the most important first.
std::vector<std::int64_t> Middles(const Known& known, std::int64_t last) {
  std::vector<std::int64_t> crossings;
  std::vector<std::pair<double, std::int64_t>> changes;  // minus the change, and the middle
  for (auto right = std::next(known.begin()); right != known.end(); ++right) {
    const auto left = std::prev(right);
    const std::int64_t length = right->first - left->first, middle = left->first + length / 2;
    if (length < 2) continue;
    const double change = std::abs(ChanceOf(right->second) - ChanceOf(left->second));
    if (IsLost(left->second) != IsLost(right->second))
      crossings.push_back(middle);
    else if (change >= kMuchChange && length > last / (kCoarseIntervals * kCloserBy))
      changes.emplace_back(-change, middle);
  }
  if (!crossings.empty()) return crossings;
  std::sort(changes.begin(), changes.end());
  std::vector<std::int64_t> middles;
  for (const auto& [change, middle] : changes) middles.push_back(middle);
  return middles;
}

NoReturn Conclude(const Known& known, const std::function<TimeNs(std::int64_t)>& time) {
  NoReturn found;
  for (const auto& [step, count] : known) {
    WhyPoint point{.time_s = ToSeconds(time(step)), .probability = ChanceOf(count)};
    point.low = point.high = point.probability;
    if (count.drawn) std::tie(point.low, point.high) = WilsonInterval(count.fails, count.futures);
    point.futures_count = count.futures;
    point.fails_count = count.fails;
    found.curve.push_back(point);
    if (IsLost(count)) {
      if (!found.point_of_no_return_s) found.point_of_no_return_s = point.time_s;
    } else {
      found.last_chance_s = point.time_s;
      found.point_of_no_return_s.reset();
    }
  }
  return found;
}

}  // namespace

NoReturn FindNoReturn(const MomentRange& range,
                      const std::function<std::vector<FutureCount>(const std::vector<TimeNs>&)>& evaluate) {
  Check(range.begin_ns <= range.end_ns && range.step_ns > 0 && range.moments_max >= 2,
        "moments are searched in a range with an order, in steps");
  // The last moment is the end itself.
  const std::int64_t last = (range.end_ns - range.begin_ns + range.step_ns - 1) / range.step_ns;
  const auto time = [&](std::int64_t step) {
    return std::min(range.begin_ns + step * range.step_ns, range.end_ns);
  };
  std::vector<std::int64_t> wanted;
  const std::int64_t coarse = std::min(
      {kCoarseIntervals, std::max<std::int64_t>(last, 1), static_cast<std::int64_t>(range.moments_max) - 1});
  for (std::int64_t i = 0; i <= coarse; ++i) wanted.push_back(last * i / coarse);
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  Known known;
  while (!wanted.empty()) {
    std::sort(wanted.begin(), wanted.end());
    std::vector<TimeNs> moments;
    for (const std::int64_t step : wanted) moments.push_back(time(step));
    const std::vector<FutureCount> counts = evaluate(moments);
    for (std::size_t i = 0; i < std::min(counts.size(), wanted.size()); ++i)
      if (counts[i].futures > 0) known[wanted[i]] = counts[i];
    if (counts.size() < wanted.size() || known.size() < 2) break;
    wanted = Middles(known, last);
    wanted.resize(std::min(wanted.size(), range.moments_max - std::min(range.moments_max, known.size())));
  }
  return Conclude(known, time);
}

}  // namespace tiltproof::harness
