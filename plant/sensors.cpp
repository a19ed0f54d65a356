#include "plant/sensors.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "link/check.h"

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Names of a kind's signals around the sensor's own name: "acc" + "_imu2" + "_x_m_s2".
struct SignalParts {
  std::string_view group, end;
};

std::span<const SignalParts> PartsOf(SensorKind kind) {
  static constexpr std::array<SignalParts, 6> kImu = {{{"acc", "_x_m_s2"},
                                                       {"acc", "_y_m_s2"},
                                                       {"acc", "_z_m_s2"},
                                                       {"gyro", "_x_rad_s"},
                                                       {"gyro", "_y_rad_s"},
                                                       {"gyro", "_z_rad_s"}}};
  static constexpr std::array<SignalParts, 3> kMagnetometer = {
      {{"mag", "_x_t"}, {"mag", "_y_t"}, {"mag", "_z_t"}}};
  static constexpr std::array<SignalParts, 1> kAirPressure = {{{"pressure", "_pa"}}};
  static constexpr std::array<SignalParts, 6> kGnss = {{{"gnss", "_lat_deg"},
                                                        {"gnss", "_lon_deg"},
                                                        {"gnss", "_alt_m"},
                                                        {"gnss", "_vn_m_s"},
                                                        {"gnss", "_ve_m_s"},
                                                        {"gnss", "_vd_m_s"}}};
  switch (kind) {
    case SensorKind::kImu:
      return kImu;
    case SensorKind::kMagnetometer:
      return kMagnetometer;
    case SensorKind::kAirPressure:
      return kAirPressure;
    case SensorKind::kGnss:
      return kGnss;
  }
  return {};
}

std::string SensorSpelled(std::string name) {
  for (char& c : name)
    if (!((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'))) c = '_';
  return name;
}

void Put(std::span<double> values, std::size_t first, const Vector3d& v) {
  for (std::size_t i = 0; i < 3; ++i) values[first + i] = v[static_cast<Eigen::Index>(i)];
}

constexpr std::size_t kSignalsMax = 6;  // of one sensor

}  // namespace

SignalTable SensorSignals(std::span<const Sensor> sensors) {
  std::vector<Signal> signals;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const SensorKind kind = sensors[i].kind;
    const bool is_first = std::none_of(sensors.begin(), sensors.begin() + static_cast<std::ptrdiff_t>(i),
                                       [kind](const Sensor& other) { return other.kind == kind; });
    const std::string own = is_first ? std::string() : fmt::format("_{}", SensorSpelled(sensors[i].name));
    // A position and a velocity on Earth have axes of their own; the others lie along the sensor's.
    const SignalFrame frame = kind == SensorKind::kImu || kind == SensorKind::kMagnetometer
                                  ? SignalFrame::kBody
                                  : SignalFrame::kNone;
    for (const SignalParts& parts : PartsOf(kind)) {
      const std::string group = std::string(parts.group) + own;
      signals.push_back(SignalNamed(group + std::string(parts.end), frame));
      signals.back().group = group;
    }
  }
  return SignalTable(std::move(signals));
}

bool HasNoise(std::span<const Sensor> sensors) {
  const auto is_noisy = [](const SensorNoise& noise) {
    return noise.mean != 0 || noise.stddev != 0 || noise.bias_mean != 0 || noise.bias_stddev != 0 ||
           noise.walk_density != 0;
  };
  return std::ranges::any_of(
      sensors, [&](const Sensor& sensor) { return std::ranges::any_of(sensor.noise, is_noisy); });
}

std::size_t SignalCount(SensorKind kind) { return PartsOf(kind).size(); }

SensorSuite::SensorSuite(const std::vector<Sensor>& sensors, const Options& options, SensorDraws draws)
    : options_(options), earth_(options.surroundings), draws_(std::move(draws)) {
  std::size_t first = 0;
  for (const Sensor& sensor : sensors) {
    Unit unit{.sensor = sensor, .first = first, .count = SignalCount(sensor.kind)};
    Check(sensor.noise.size() == unit.count, "a sensor has a noise for each of its signals");
    const TimeNs wanted_ns = sensor.rate_hz > 0 ? FromSeconds(1 / sensor.rate_hz) : 0;
    unit.period_ns = std::max({wanted_ns, options.step_ns, TimeNs{1}});
    unit.bias.assign(unit.count, 0.0);
    unit.walk.assign(unit.count, 0.0);
    // As many samples may be under way at once, and the one that is just taken.
    const TimeNs latency_ns = FromSeconds(sensor.latency_s);
    unit.ring.resize(static_cast<std::size_t>(latency_ns / unit.period_ns) + 2);
    for (Unit::Pending& pending : unit.ring) pending.values.assign(unit.count, 0.0);
    first += unit.count;
    units_.push_back(std::move(unit));
  }
  readings_.assign(first, 0.0);
}

void SensorSuite::Start(const BaseMotion& motion) {
  time_ns_ = 0;
  motion_ = motion;
  force_B_m_s2_ = motion.R_WB.transpose() * Vector3d(0, 0, options_.gravity_m_s2);
  dw_B_rad_s2_ = p_com_m_ = Vector3d::Zero();
  w_B_rad_s_ = motion.R_WB.transpose() * motion.w_WB_rad_s;
  for (Unit& unit : units_) {
    unit.sample_count = 0;
    unit.ring_begin = unit.ring_count = 0;
    for (std::size_t i = 0; i < unit.count; ++i) {
      const SensorNoise& noise = unit.sensor.noise[i];
      unit.walk[i] = 0;
      unit.bias[i] = noise.bias_mean;
      if (draws_ && noise.bias_stddev > 0)
        unit.bias[i] += noise.bias_stddev * draws_(unit.first + i, NoisePart::kBias, 0);
    }
    Sample(unit, std::span(readings_).subspan(unit.first, unit.count));
    unit.next_sample_ns = unit.period_ns;
  }
}

void SensorSuite::Step(const BaseMotion& motion, const Vector3d& p_com_m) {
  const double step_s = ToSeconds(options_.step_ns);
  time_ns_ += options_.step_ns;
  const Matrix3d R_BW = motion_.R_WB.transpose();
  const auto v_com = [&](const BaseMotion& of) -> Vector3d {
    return of.v_WB_m_s + of.w_WB_rad_s.cross(of.R_WB * p_com_m);
  };
  // The forces of a step act along the axes of its begin.
  force_B_m_s2_ = R_BW * ((v_com(motion) - v_com(motion_)) / step_s + Vector3d(0, 0, options_.gravity_m_s2));
  const Vector3d w_before = R_BW * motion_.w_WB_rad_s, w_after = motion.R_WB.transpose() * motion.w_WB_rad_s;
  dw_B_rad_s2_ = (w_after - w_before) / step_s;
  w_B_rad_s_ = 0.5 * (w_before + w_after);
  p_com_m_ = p_com_m;
  motion_ = motion;
  for (Unit& unit : units_) {
    if (time_ns_ >= unit.next_sample_ns) {
      unit.next_sample_ns += unit.period_ns;
      CheckIndex(unit.ring_count, unit.ring.size(), "a sensor has room for the samples under way");
      Unit::Pending& pending = unit.ring[(unit.ring_begin + unit.ring_count++) % unit.ring.size()];
      pending.due_ns = time_ns_ + FromSeconds(unit.sensor.latency_s);
      Sample(unit, pending.values);
    }
    TakeDue(unit);
  }
}

void SensorSuite::TakeDue(Unit& unit) {
  while (unit.ring_count > 0 && unit.ring[unit.ring_begin].due_ns <= time_ns_) {
    const std::vector<double>& values = unit.ring[unit.ring_begin].values;
    std::copy(values.begin(), values.end(), readings_.begin() + static_cast<std::ptrdiff_t>(unit.first));
    unit.ring_begin = (unit.ring_begin + 1) % unit.ring.size();
    --unit.ring_count;
  }
}

void SensorSuite::Read(std::span<double> readings) const {
  Check(readings.size() == readings_.size(), "a row of readings has a number for each signal");
  std::copy(readings_.begin(), readings_.end(), readings.begin());
}

void SensorSuite::Sample(Unit& unit, std::span<double> values) {
  std::array<double, kSignalsMax> noise_scale{};
  Check(unit.count <= kSignalsMax, "a sensor has no more signals than there is room for");
  noise_scale.fill(1.0);
  Measure(unit.sensor, values, noise_scale);
  AddNoise(unit, values, noise_scale);
  unit.last_sample_ns = time_ns_;
  ++unit.sample_count;
}

// `noise_scale` is 1 before: signal's units in one unit of noise.
void SensorSuite::Measure(const Sensor& sensor, std::span<double> values,
                          std::span<double> noise_scale) const {
  const Vector3d to_sensor_W = motion_.R_WB * sensor.p_BS_m;
  const Vector3d p_W = motion_.p_WB_m + to_sensor_W;
  switch (sensor.kind) {
    case SensorKind::kImu: {
      const Vector3d arm = sensor.p_BS_m - p_com_m_;
      const Vector3d force_B =
          force_B_m_s2_ + dw_B_rad_s2_.cross(arm) + w_B_rad_s_.cross(w_B_rad_s_.cross(arm));
      Put(values, 0, sensor.R_BS.transpose() * force_B);
      Put(values, 3, sensor.R_BS.transpose() * (motion_.R_WB.transpose() * motion_.w_WB_rad_s));
      return;
    }
    case SensorKind::kMagnetometer:
      Put(values, 0,
          sensor.R_BS.transpose() * (motion_.R_WB.transpose() * options_.surroundings.magnetic_field_t));
      return;
    case SensorKind::kAirPressure:
      values[0] = StandardPressure_pa(options_.surroundings.elevation_m + sensor.altitude_m + p_W.z());
      return;
    case SensorKind::kGnss: {
      const GeographicPoint at = earth_.CoordinatesOf(p_W);
      values[0] = at.latitude_deg;
      values[1] = at.longitude_deg;
      values[2] = at.altitude_m;
      Put(values, 3, earth_.NorthEastDown(motion_.v_WB_m_s + motion_.w_WB_rad_s.cross(to_sensor_W), at));
      noise_scale[0] = 1 / at.north_m_per_deg;
      noise_scale[1] = 1 / at.east_m_per_deg;
      return;
    }
  }
}

void SensorSuite::AddNoise(Unit& unit, std::span<double> values, std::span<const double> noise_scale) const {
  const double since_s = ToSeconds(time_ns_ - unit.last_sample_ns);
  for (std::size_t i = 0; i < unit.count; ++i) {
    const SensorNoise& noise = unit.sensor.noise[i];
    const std::size_t signal = unit.first + i;
    if (draws_) {
      double error = noise.mean + unit.bias[i];
      if (noise.stddev > 0) error += noise.stddev * draws_(signal, NoisePart::kWhite, unit.sample_count);
      if (noise.walk_density > 0 && unit.sample_count > 0) {
        const double time_s = noise.walk_time_s;
        const double kept = time_s > 0 ? std::exp(-since_s / time_s) : 1.0;
        const double variance_s = time_s > 0 ? -0.5 * time_s * std::expm1(-2 * since_s / time_s) : since_s;
        unit.walk[i] = kept * unit.walk[i] + noise.walk_density * std::sqrt(variance_s) *
                                                 draws_(signal, NoisePart::kWalk, unit.sample_count);
      }
      values[i] += noise_scale[i] * (error + unit.walk[i]);
    }
    if (noise.quantum > 0) {
      const double step = noise.quantum * noise_scale[i];
      values[i] = std::round(values[i] / step) * step;
    }
  }
}

}  // namespace tiltproof::plant
