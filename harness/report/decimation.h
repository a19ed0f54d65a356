// A signal for a plot: few of its points, with all its extremes.
//
//   const std::vector<std::size_t> rows = DecimatedRows(values, 1500);
//   for (const std::size_t row : rows) Draw(times[row], values[row]);
//
// The rows are cut into buckets of equal length. Of each bucket stay its first row, the first smallest and the first
// largest value, and, where values are missing, the first row without one: a peak of one row is seen at its own time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace tiltproof::harness {

// Ascending, without repeats, at most `points_max` (at least 8), with the first and the last row; all rows when they are
// not more.
std::vector<std::size_t> DecimatedRows(std::span<const double> values, std::size_t points_max);

// The points of a series in few bytes that compress well (PackSeries).
struct PackedSeries {
  std::size_t count = 0;
  double low = 0, high = 0;  // of the finite values; both exact
  std::string bytes;
};

// Number of levels between the least and the greatest value.
inline constexpr std::uint16_t kLevelMax = 16'380;
// Codes beyond the levels.
inline constexpr std::uint16_t kPlusInfinity = 65'533, kMinusInfinity = 65'534, kNotANumber = 65'535;

// Bytes: for each point the distance to the previous row as LEB128; then the low bytes and then the high bytes of the
// differences of levels, as 16 bit numbers in zigzag code. A value is low + level / kLevelMax * (high - low), off by
// at most half a level.
PackedSeries PackSeries(std::span<const double> values, std::span<const std::size_t> rows);

// The inverse, as the page does it too.
struct SeriesPoint {
  std::size_t row = 0;
  double value = 0;
};
std::vector<SeriesPoint> UnpackSeries(const PackedSeries& series);

}  // namespace tiltproof::harness
