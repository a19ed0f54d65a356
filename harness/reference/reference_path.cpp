#include "harness/reference/reference_path.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tiltproof::harness {
namespace {

bool IsFinite(const Point& p) { return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]); }

double DistanceSquared(const Point& a, const Point& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

// From p to the nearest point of an axis-aligned box.
double BoxDistanceSquared(const Point& low, const Point& high, const Point& p) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double outside = std::max({low[i] - p[i], p[i] - high[i], 0.0});
    sum += outside * outside;
  }
  return sum;
}

}  // namespace

double Distance(const Point& a, const Point& b) { return std::sqrt(DistanceSquared(a, b)); }

ReferencePath::ReferencePath(std::span<const Point> points) {
  for (const Point& p : points)
    if (IsFinite(p) && (points_.empty() || points_.back() != p)) points_.push_back(p);
  if (points_.size() < 2) return;
  const std::size_t segments = points_.size() - 1;
  boxes_.resize(2 * std::bit_ceil(segments));
  Build(0, 0, segments);
}

// Over the segments [first, last), at least one.
ReferencePath::Box ReferencePath::Build(std::size_t node, std::size_t first, std::size_t last) {
  Box box;
  if (last - first == 1) {
    for (std::size_t i = 0; i < 3; ++i) {
      box.low[i] = std::min(points_[first][i], points_[last][i]);
      box.high[i] = std::max(points_[first][i], points_[last][i]);
    }
  } else {
    const std::size_t middle = first + (last - first) / 2;
    const Box left = Build(2 * node + 1, first, middle);
    const Box right = Build(2 * node + 2, middle, last);
    for (std::size_t i = 0; i < 3; ++i) {
      box.low[i] = std::min(left.low[i], right.low[i]);
      box.high[i] = std::max(left.high[i], right.high[i]);
    }
  }
  boxes_[node] = box;
  return box;
}

double ReferencePath::SegmentDistanceSquared(std::size_t segment, const Point& p) const {
  const Point& a = points_[segment];
  const Point& b = points_[segment + 1];
  double along = 0.0;
  for (std::size_t i = 0; i < 3; ++i) along += (p[i] - a[i]) * (b[i] - a[i]);
  const double length_squared =
      DistanceSquared(a, b);  // 0 when two different points are too close for their square
  const double s = length_squared > 0.0 ? std::clamp(along / length_squared, 0.0, 1.0) : 0.0;
  Point nearest;
  for (std::size_t i = 0; i < 3; ++i) nearest[i] = a[i] + s * (b[i] - a[i]);
  return DistanceSquared(nearest, p);
}

// Branch and bound, the nearer half first.
void ReferencePath::Search(std::size_t node, std::size_t first, std::size_t last, const Point& p,
                           double& best) const {
  if (last - first == 1) {
    best = std::min(best, SegmentDistanceSquared(first, p));
    return;
  }
  const std::size_t middle = first + (last - first) / 2;
  const auto distance = [&](std::size_t child) {
    return BoxDistanceSquared(boxes_[child].low, boxes_[child].high, p);
  };
  const std::size_t left = 2 * node + 1, right = 2 * node + 2;
  const double to_left = distance(left), to_right = distance(right);
  const bool left_first = to_left <= to_right;
  if (left_first && to_left < best) Search(left, first, middle, p, best);
  if (to_right < best) Search(right, middle, last, p, best);
  if (!left_first && to_left < best) Search(left, first, middle, p, best);
}

double ReferencePath::DistanceTo(const Point& p) const {
  if (points_.empty() || !IsFinite(p)) return std::numeric_limits<double>::quiet_NaN();
  if (boxes_.empty()) return Distance(points_.front(), p);
  double best = std::numeric_limits<double>::infinity();
  Search(0, 0, points_.size() - 1, p, best);
  return std::sqrt(best);
}

}  // namespace tiltproof::harness
