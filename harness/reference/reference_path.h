// Distance from points to a long polyline: the path that a flight should have followed. One query costs about
// the logarithm of the path's length; where the path passes the same place in several laps, this cost for
// each lap.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace tiltproof::harness {

using Point = std::array<double, 3>;  // world frame, m

// Euclidean; NaN when a coordinate is.
double Distance(const Point& a, const Point& b);

class ReferencePath {
 public:
  // The polyline through `points` in order. Points that are not finite, and repetitions of their predecessor,
  // are left out.
  explicit ReferencePath(std::span<const Point> points);

  // Smallest distance from p to the polyline (m): NaN when p is not finite or there is no path.
  double DistanceTo(const Point& p) const;

 private:
  struct Box {
    Point low, high;
  };
  double SegmentDistanceSquared(std::size_t segment, const Point& p) const;
  void Search(std::size_t node, std::size_t first, std::size_t last, const Point& p, double& best) const;
  Box Build(std::size_t node, std::size_t first, std::size_t last);

  std::vector<Point> points_;
  std::vector<Box> boxes_;  // a binary tree over ranges of segments: children of node i are 2i + 1 and 2i + 2
};

}  // namespace tiltproof::harness
