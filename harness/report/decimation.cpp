#include "harness/report/decimation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Appends the rows of [begin, end) that stay.
void KeepOfBucket(std::span<const double> values, std::size_t begin, std::size_t end,
                  std::vector<std::size_t>& rows) {
  Check(begin < end && end <= values.size(), "a bucket has rows of its series");
  std::size_t least = end, greatest = end, missing = end;
  for (std::size_t r = begin; r < end; ++r) {
    if (std::isnan(values[r])) {
      missing = std::min(missing, r);
      continue;
    }
    if (least == end || values[r] < values[least]) least = r;
    if (greatest == end || values[r] > values[greatest]) greatest = r;
  }
  std::array<std::size_t, 4> kept = {begin, least, greatest, missing};
  std::sort(kept.begin(), kept.end());
  for (const std::size_t row : kept)
    if (row != end && (rows.empty() || rows.back() != row)) rows.push_back(row);
}

std::uint16_t Level(double value, double low, double high) {
  if (std::isnan(value)) return kNotANumber;
  if (std::isinf(value)) return value > 0 ? kPlusInfinity : kMinusInfinity;
  // Halves: the range of two finite numbers may be infinite.
  const double range = high / 2 - low / 2;
  if (range <= 0) return 0;
  return static_cast<std::uint16_t>(std::lround((value / 2 - low / 2) / range * kLevelMax));
}

double ValueOf(std::uint16_t level, double low, double high) {
  if (level == kNotANumber) return std::numeric_limits<double>::quiet_NaN();
  if (level == kPlusInfinity) return std::numeric_limits<double>::infinity();
  if (level == kMinusInfinity) return -std::numeric_limits<double>::infinity();
  if (level == kLevelMax) return high;
  const double share = static_cast<double>(level) / kLevelMax;
  return low * (1 - share) + high * share;
}

}  // namespace

std::vector<std::size_t> DecimatedRows(std::span<const double> values, std::size_t points_max) {
  Check(points_max >= 8, "a series of at least 8 points");
  std::vector<std::size_t> rows;
  if (values.size() <= points_max) {
    for (std::size_t r = 0; r < values.size(); ++r) rows.push_back(r);
    return rows;
  }
  const bool missing = std::any_of(values.begin(), values.end(), [](double v) { return std::isnan(v); });
  // One point is for the last row.
  const std::size_t buckets = (points_max - 1) / (missing ? 4 : 3);
  for (std::size_t b = 0; b < buckets; ++b)
    KeepOfBucket(values, b * values.size() / buckets, (b + 1) * values.size() / buckets, rows);
  if (rows.back() != values.size() - 1) rows.push_back(values.size() - 1);
  return rows;
}

PackedSeries PackSeries(std::span<const double> values, std::span<const std::size_t> rows) {
  PackedSeries packed;
  packed.count = rows.size();
  bool found = false;
  for (const std::size_t row : rows) {
    CheckIndex(row, values.size(), "a point of a series is one of its rows");
    const double value = values[row];
    if (!std::isfinite(value)) continue;
    packed.low = found ? std::min(packed.low, value) : value;
    packed.high = found ? std::max(packed.high, value) : value;
    found = true;
  }
  std::size_t previous_row = 0;
  std::uint16_t previous_level = 0;
  std::string low_bytes, high_bytes;
  for (const std::size_t row : rows) {
    Check(row >= previous_row, "the points of a series are in order");
    std::size_t distance = row - previous_row;
    for (; distance >= 0x80; distance >>= 7) packed.bytes += static_cast<char>(0x80 | (distance & 0x7F));
    packed.bytes += static_cast<char>(distance);
    previous_row = row;
    const std::uint16_t level = Level(values[row], packed.low, packed.high);
    const auto difference = static_cast<std::int16_t>(level - previous_level);
    const auto code = static_cast<std::uint16_t>((difference << 1) ^ (difference >> 15));
    previous_level = level;
    low_bytes += static_cast<char>(code & 0xFF);
    high_bytes += static_cast<char>(code >> 8);
  }
  packed.bytes += low_bytes + high_bytes;
  return packed;
}

std::vector<SeriesPoint> UnpackSeries(const PackedSeries& series) {
  std::vector<SeriesPoint> points(series.count);
  const auto byte_at = [&](std::size_t i) { return static_cast<std::uint8_t>(series.bytes.at(i)); };
  std::size_t at = 0, row = 0;
  for (SeriesPoint& point : points) {
    std::size_t distance = 0;
    for (unsigned shift = 0;; shift += 7) {
      const std::uint8_t byte = byte_at(at++);
      distance |= static_cast<std::size_t>(byte & 0x7F) << shift;
      if (byte < 0x80) break;
    }
    point.row = row += distance;
  }
  std::uint16_t level = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto code = static_cast<std::uint16_t>(byte_at(at + i) | (byte_at(at + points.size() + i) << 8));
    level = static_cast<std::uint16_t>(level + ((code >> 1) ^ -(code & 1)));
    points[i].value = ValueOf(level, series.low, series.high);
  }
  return points;
}

}  // namespace tiltproof::harness
