// The sensors of a vehicle's file: what they read, when, and with which noise.
//
//   SensorSuite suite(model.sensors, {.step_ns = 4 * kNsPerMs}, draws);
//   suite.Start(motion);                          // at rest, or in steady motion
//   suite.Step(later, model.base.p_com_m);        // once for each step of the plant
//   suite.Read(row);                              // in the order of SensorSignals(model.sensors)
//
// All sensors are rigid with the main body. A sensor samples at the first step boundary at or after each multiple of its
// period, and a reading comes out its latency later. Between readings the last one holds. The first sample, at the
// start, comes out at once.
//
// Readings without noise, at the sensor's place and along its axes:
//
//   acc       specific force: mean over the last step of the centre of mass's acceleration less gravity, along the
//             body's axes at the begin of the step, plus dw/dt x r + w x (w x r) with the mean w of the step
//   gyro      angular velocity
//   mag       the world's magnetic field
//   pressure  of the standard atmosphere
//   gnss      coordinates on the WGS 84 ellipsoid; velocity north, east, down
//
// Noise of SDF's <noise>, of each number by itself: reading + mean + white + constant bias + slow bias. The slow bias b
// follows db = -b/T dt + sigma dW from 0 on, where sigma is <dynamic_bias_stddev> and T <dynamic_bias_correlation_time>;
// without T it is a random walk. It is advanced exactly from sample to sample.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "link/signal_table.h"
#include "link/time.h"
#include "plant/surroundings.h"

namespace tiltproof::plant {

enum class SensorKind : unsigned char { kImu, kMagnetometer, kAirPressure, kGnss };

// In the unit of the signal; of a latitude or longitude, m.
struct SensorNoise {
  double mean = 0, stddev = 0;            // of each sample
  double bias_mean = 0, bias_stddev = 0;  // of the constant bias, drawn once for each flight
  double walk_density = 0;                // sigma of the slow bias: unit/s/sqrt(Hz)
  double walk_time_s = 0;                 // its correlation time; 0: a random walk
  double quantum = 0;                     // the reading is a multiple of it; 0: any number
};

struct Sensor {
  SensorKind kind{};
  std::string name;
  Eigen::Vector3d p_BS_m = Eigen::Vector3d::Zero();  // pose in the base frame
  Eigen::Matrix3d R_BS = Eigen::Matrix3d::Identity();
  double rate_hz = 0;  // 0: at every step
  double latency_s = 0;
  double altitude_m = 0;                // of an air pressure sensor: added to its altitude
  std::vector<SensorNoise> noise = {};  // of each signal
};

// The signals that the sensors read. The first sensor of a kind has the kind's names, a further one its own name in
// them: acc_x_m_s2, acc_imu2_x_m_s2. Characters of its name that no signal can have become '_'.
SignalTable SensorSignals(std::span<const Sensor> sensors);

// True if a reading of one of them is not what it measures, apart from steps of its quantum.
bool HasNoise(std::span<const Sensor> sensors);

// Number of signals of a sensor of that kind.
std::size_t SignalCount(SensorKind kind);

// The motion of the main body's frame, along the world's axes.
struct BaseMotion {
  Eigen::Vector3d p_WB_m, v_WB_m_s, w_WB_rad_s;
  Eigen::Matrix3d R_WB;
};

enum class NoisePart : unsigned char { kWhite, kBias, kWalk };
// A number with mean 0 and standard deviation 1, which follows only from the signal's place in the table, the part and
// the number of the sample. Sensors without draws have no noise.
using SensorDraws = std::function<double(std::size_t signal, NoisePart part, std::uint64_t number)>;

class SensorSuite {
 public:
  struct Options {
    Surroundings surroundings = {};
    TimeNs step_ns = 0;  // > 0
    double gravity_m_s2 = 0;
  };
  SensorSuite(const std::vector<Sensor>& sensors, const Options& options, SensorDraws draws);

  bool empty() const { return units_.empty(); }
  // Starts the sensors' time at 0. The body's velocities are constant until then.
  void Start(const BaseMotion& motion);
  // The motion one step later; `p_com_m` is the centre of mass in the base frame.
  void Step(const BaseMotion& motion, const Eigen::Vector3d& p_com_m);
  // The readings at this time.
  void Read(std::span<double> readings) const;

 private:
  // One sensor, and its state.
  struct Unit {
    Sensor sensor;
    std::size_t first = 0, count = 0;  // its signals
    TimeNs period_ns = 0, next_sample_ns = 0, last_sample_ns = 0;
    std::uint64_t sample_count = 0;
    std::vector<double> bias = {}, walk = {};
    // Samples that have not come out yet, in a ring.
    struct Pending {
      TimeNs due_ns = 0;
      std::vector<double> values = {};
    };
    std::vector<Pending> ring = {};
    std::size_t ring_begin = 0, ring_count = 0;
  };

  void Sample(Unit& unit, std::span<double> values);
  void Measure(const Sensor& sensor, std::span<double> values, std::span<double> noise_scale) const;
  void AddNoise(Unit& unit, std::span<double> values, std::span<const double> noise_scale) const;
  void TakeDue(Unit& unit);

  Options options_;
  EarthFrame earth_;
  SensorDraws draws_;
  std::vector<Unit> units_;
  std::vector<double> readings_;
  TimeNs time_ns_ = 0;
  BaseMotion motion_{};
  // The last step, along the body's axes: specific force at the centre of mass, angular acceleration, mean angular
  // velocity.
  Eigen::Vector3d force_B_m_s2_, dw_B_rad_s2_, w_B_rad_s_, p_com_m_;
};

}  // namespace tiltproof::plant
