#include "harness/reference/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <numbers>
#include <string_view>
#include <system_error>
#include <variant>

namespace tiltproof::harness {
namespace {

constexpr std::size_t kRecordedRowsMax = 1'000'000;
constexpr std::size_t kRecordedLineBytesMax = 4096;
// Positions (m) end where a flight counts as diverged; all lie within what the reference message may carry.
constexpr double kMagnitudeMax = 1e3;
constexpr double kYawMax_rad = 100.0;

// Spreadsheets put it before a file in UTF-8.
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::size_t kZ = 3, kYaw = 4, kVelocity = 5;  // places in kColumns
constexpr std::array<std::string_view, 8> kColumns = {"t_s",     "x_m",    "y_m",    "z_m",
                                                      "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s"};

ReferencePoint AtRest(const std::array<double, 3>& p_m, double yaw_rad = 0.0) {
  ReferencePoint r;
  r.position_m = p_m;
  r.yaw_rad = yaw_rad;
  return r;
}

double LegLength(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
}

double AngularFrequency(double turns_count, double time_s) {
  return 2 * std::numbers::pi * turns_count / time_s;
}

std::vector<std::string_view> SplitAtCommas(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

// Places in a line of kColumns: all of them, or those before the velocities. Throws ReferenceError.
std::vector<std::size_t> FindColumns(std::string_view header) {
  const std::vector<std::string_view> names = SplitAtCommas(header);
  const auto count = [&](std::string_view name) { return std::count(names.begin(), names.end(), name); };
  const bool has_velocity =
      std::any_of(kColumns.begin() + kVelocity, kColumns.end(), [&](auto name) { return count(name) > 0; });
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < (has_velocity ? kColumns.size() : kVelocity); ++i) {
    if (count(kColumns[i]) == 0)
      throw ReferenceError(
          fmt::format("there is no column '{}': the first line names the columns t_s, x_m, y_m, z_m, "
                      "yaw_rad, and vx_m_s, "
                      "vy_m_s, vz_m_s if there are velocities",
                      kColumns[i]));
    if (count(kColumns[i]) > 1) throw ReferenceError(fmt::format("there are two columns '{}'", kColumns[i]));
    places.push_back(
        static_cast<std::size_t>(std::find(names.begin(), names.end(), kColumns[i]) - names.begin()));
  }
  return places;
}

// Yaw between two samples. Samples more than half a turn apart are those of a log in [-pi, pi]: the short way
// leads over its end.
double YawBetween(double from_rad, double to_rad, double part) {
  constexpr double kTurn_rad = 2 * std::numbers::pi;
  const double turn_rad = to_rad - from_rad;
  if (std::abs(turn_rad) <= std::numbers::pi) return from_rad + part * turn_rad;
  return std::remainder(from_rad + part * std::remainder(turn_rad, kTurn_rad), kTurn_rad);
}

void StripCarriageReturn(std::string& line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
}

ReferencePoint Evaluate(const HoverReference& hover, double) { return AtRest(hover.at_m, hover.yaw_rad); }

// Eq. (1) writes x = d cos wt - x_r(0) + x_0. Its x_r(0), y_r(0), z_r(0) are those of the bare curve (d, 0,
// 0), so that the reference begins at the start point.
ReferencePoint Evaluate(const SpiralReference& spiral, double t_s) {
  const double d = spiral.radius_m;
  const double w = AngularFrequency(spiral.turns_count, spiral.time_s);
  const double climb_m_s = spiral.height_m / spiral.time_s;
  const double t = std::min(t_s, spiral.time_s);
  ReferencePoint r;
  r.position_m[0] = d * std::cos(w * t) - d + spiral.start_m[0];
  r.position_m[1] = d * std::sin(w * t) + spiral.start_m[1];
  r.position_m[2] = climb_m_s * t + spiral.start_m[2];
  if (t_s < spiral.time_s) {
    r.velocity_m_s[0] = -d * w * std::sin(w * t);
    r.velocity_m_s[1] = d * w * std::cos(w * t);
    r.velocity_m_s[2] = climb_m_s;
  }
  return r;
}

// The start point lies at angle zero, so the centre is `radius_m` from it towards -x.
ReferencePoint Evaluate(const CircleReference& circle, double t_s) {
  const double d = circle.radius_m;
  const double w = AngularFrequency(1.0, circle.period_s);
  ReferencePoint r;
  r.position_m[0] = d * std::cos(w * t_s) - d + circle.start_m[0];
  r.position_m[1] = d * std::sin(w * t_s) + circle.start_m[1];
  r.position_m[2] = circle.start_m[2];
  r.velocity_m_s[0] = -d * w * std::sin(w * t_s);
  r.velocity_m_s[1] = d * w * std::cos(w * t_s);
  return r;
}

// The lemniscate of Gerono about the start point: `width_m` wide along x, half of that along y.
ReferencePoint Evaluate(const EightReference& eight, double t_s) {
  const double a = eight.width_m / 2;
  const double b = eight.width_m / 4;
  const double w = AngularFrequency(1.0, eight.period_s);
  ReferencePoint r;
  r.position_m[0] = a * std::sin(w * t_s) + eight.start_m[0];
  r.position_m[1] = b * std::sin(2 * w * t_s) + eight.start_m[1];
  r.position_m[2] = eight.start_m[2];
  r.velocity_m_s[0] = a * w * std::cos(w * t_s);
  r.velocity_m_s[1] = 2 * b * w * std::cos(2 * w * t_s);
  return r;
}

ReferencePoint Evaluate(const StraightReference& line, double t_s) {
  if (t_s >= line.time_s) return AtRest(line.to_m);
  const double part = t_s / line.time_s;
  std::array<double, 3> p_m{}, v_m_s{};
  for (std::size_t i = 0; i < p_m.size(); ++i) {
    const double way_m = line.to_m[i] - line.from_m[i];
    p_m[i] = line.from_m[i] + part * way_m;
    v_m_s[i] = way_m / line.time_s;
  }
  ReferencePoint r = AtRest(p_m);
  r.velocity_m_s = v_m_s;
  return r;
}

}  // namespace

Trajectory::Trajectory(const ReferenceSpec& spec) : spec_(spec) {
  if (const auto* recorded = std::get_if<RecordedReference>(&spec_.path)) {
    polyline_ = ReadRecorded(recorded->file);
  } else if (const auto* waypoints = std::get_if<WaypointsReference>(&spec_.path)) {
    polyline_ = FromWaypoints(*waypoints);
  }
}

ReferencePoint Trajectory::At(TimeNs time_ns) const {
  const double t_s = ToSeconds(std::max<TimeNs>(time_ns, 0));
  ReferencePoint r = std::visit(
      [&](const auto& path) {
        if constexpr (requires { Evaluate(path, t_s); }) {
          return Evaluate(path, t_s);
        } else {
          return polyline_.At(t_s);
        }
      },
      spec_.path);
  if (!spec_.velocity || time_ns < 0) r.velocity_m_s = {};
  return r;
}

double Trajectory::FirstSample_s() const {
  return polyline_.samples.empty() ? 0 : polyline_.samples.front().t_s;
}

std::array<double, 3> Trajectory::Start() const {
  const ReferencePoint r = At(0);
  return r.position_m;
}

Trajectory::Polyline Trajectory::FromWaypoints(const WaypointsReference& waypoints) {
  if (waypoints.points_m.empty()) throw ReferenceError("a waypoints reference needs at least one point");
  if (!(waypoints.speed_m_s > 0)) throw ReferenceError("a waypoints reference needs a positive speed");
  Polyline polyline;
  double t_s = 0.0;
  for (std::size_t i = 0; i < waypoints.points_m.size(); ++i) {
    const auto& point_m = waypoints.points_m[i];
    if (i > 0) t_s += LegLength(waypoints.points_m[i - 1], point_m) / waypoints.speed_m_s;
    polyline.samples.push_back({t_s, AtRest(point_m)});
  }
  return polyline;
}

ReferencePoint Trajectory::Polyline::At(double t_s) const {
  const auto hold = [](ReferencePoint r) {
    r.velocity_m_s = {};
    return r;
  };
  if (t_s < samples.front().t_s) return hold(samples.front().value);
  if (t_s >= samples.back().t_s) return hold(samples.back().value);
  const auto next = std::upper_bound(samples.begin(), samples.end(), t_s,
                                     [](double t, const Sample& s) { return t < s.t_s; });
  const Sample& a = *(next - 1);
  const Sample& b = *next;
  const double length_s = b.t_s - a.t_s;
  const double part = (t_s - a.t_s) / length_s;
  const auto between = [part](double from, double to) { return from + part * (to - from); };
  ReferencePoint r;
  r.yaw_rad = YawBetween(a.value.yaw_rad, b.value.yaw_rad, part);
  for (std::size_t i = 0; i < 3; ++i) {
    const double from_m = a.value.position_m[i], to_m = b.value.position_m[i];
    r.position_m[i] = between(from_m, to_m);
    r.velocity_m_s[i] =
        has_velocity ? between(a.value.velocity_m_s[i], b.value.velocity_m_s[i]) : (to_m - from_m) / length_s;
  }
  return r;
}

Trajectory::Polyline Trajectory::ReadRecorded(const std::filesystem::path& file) {
  std::size_t line_number = 0;
  const auto fail = [&](const std::string& message) {
    throw ReferenceError(fmt::format("{}:{}: {}", file.string(), line_number, message));
  };
  if (!std::filesystem::is_regular_file(file)) throw ReferenceError(file.string() + ": not a readable file");
  std::ifstream in(file);
  if (!in) throw ReferenceError(file.string() + ": not a readable file");

  std::string line;
  line_number = 1;
  std::getline(in, line);
  StripCarriageReturn(line);
  if (line.starts_with(kByteOrderMark)) line.erase(0, kByteOrderMark.size());
  std::vector<std::size_t> places;
  try {
    places = FindColumns(line);
  } catch (const ReferenceError& error) {
    fail(error.what());
  }
  const std::size_t column_count = SplitAtCommas(line).size();

  Polyline polyline;
  polyline.has_velocity = places.size() > kVelocity;
  std::vector<Sample>& samples = polyline.samples;
  while (std::getline(in, line)) {
    ++line_number;
    StripCarriageReturn(line);
    if (line.empty() && in.peek() == std::ifstream::traits_type::eof()) break;
    if (line.size() > kRecordedLineBytesMax) fail("the line is too long");
    if (samples.size() == kRecordedRowsMax) fail(fmt::format("more than {} rows", kRecordedRowsMax));
    const std::vector<std::string_view> cells = SplitAtCommas(line);
    std::vector<double> numbers;
    for (const std::size_t place : places) {
      if (place >= cells.size()) break;
      const std::string_view cell = cells[place];
      const char* const end = cell.data() + cell.size();
      double number = 0.0;
      const auto [rest, error] = std::from_chars(cell.data(), end, number);
      if (error != std::errc() || rest != end || !std::isfinite(number)) {
        fail(fmt::format("'{}' is not a number", cell));
      }
      numbers.push_back(number);
    }
    if (cells.size() != column_count) {
      fail(fmt::format("has {} columns, the first line has {}", cells.size(), column_count));
    }
    Sample sample;
    sample.t_s = numbers[0];
    for (std::size_t i = 1; i < numbers.size(); ++i) {
      const bool is_yaw = i == kYaw;
      if (std::abs(numbers[i]) > (is_yaw ? kYawMax_rad : kMagnitudeMax)) {
        fail(is_yaw ? "yaw_rad is beyond +/-100 rad" : "a value is beyond +/-1000 m or m/s");
      }
    }
    if (numbers[kZ] < 0) {
      fail(fmt::format(
          "z_m = {} is in the ground: z points up (a recording in NED becomes one with x_m and y_m "
          "exchanged, -z_m, and pi/2 - yaw_rad)",
          numbers[kZ]));
    }
    std::vector<double> row(numbers.begin() + 1, numbers.end());
    row.resize(ReferenceSignals().size());  // without velocities they are 0
    sample.value = *FromRow(row);
    if (!samples.empty() && !(sample.t_s > samples.back().t_s)) fail("t_s must ascend");
    samples.push_back(sample);
  }
  if (samples.empty()) fail("has no rows");
  return polyline;
}

}  // namespace tiltproof::harness
