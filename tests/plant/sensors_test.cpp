// Sensors of a vehicle's file: readings against formulas of the test's own, noise by statistics.
#include "plant/sensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <numeric>

#include "faults/random.h"
#include "plant/plant.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::ElementsAre;

constexpr TimeNs kStep = 4 * kNsPerMs;
constexpr double kStep_s = 0.004;

Sensor SensorOf(SensorKind kind, std::string name = "one") {
  Sensor sensor{.kind = kind, .name = std::move(name)};
  sensor.noise.resize(SignalCount(kind));
  return sensor;
}

SensorDraws DrawsFrom(std::uint64_t seed) {
  return [seed](std::size_t signal, NoisePart part, std::uint64_t number) {
    const std::string name = std::to_string(signal) + std::to_string(static_cast<int>(part));
    return faults::Random(faults::KeyOf(faults::StreamKey(seed, {name}), number)).StandardNormal();
  };
}

BaseMotion AtRest() { return {Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(), Matrix3d::Identity()}; }

std::vector<double> Readings(const SensorSuite& suite, std::size_t count) {
  std::vector<double> row(count);
  suite.Read(row);
  return row;
}

// The tilt-rotor with sensors.
VehicleModel WithSensors(const std::vector<Sensor>& sensors) {
  VehicleModel model = Model();
  model.sensors = sensors;
  return model;
}

std::vector<double> Measured(const Plant& plant, const VehicleModel& model) {
  std::vector<double> row(model.signals().measured.size());
  plant.Measure(row);
  return row;
}

TEST(Sensors, TheFirstOfAKindHasItsNamesAndAFurtherOneItsOwn) {
  const SignalTable table = SensorSignals(std::vector<Sensor>{
      SensorOf(SensorKind::kImu, "imu1"), SensorOf(SensorKind::kGnss, "gps"),
      SensorOf(SensorKind::kImu, "imu2"), SensorOf(SensorKind::kMagnetometer, "compass"),
      SensorOf(SensorKind::kAirPressure, "baro"), SensorOf(SensorKind::kAirPressure, "wing::baro 2")});
  std::vector<std::string> names, units, groups;
  for (const Signal& signal : table) {
    names.push_back(signal.name);
    units.push_back(signal.unit);
    groups.push_back(signal.group);
  }
  EXPECT_THAT(names,
              ElementsAre("acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2", "gyro_x_rad_s", "gyro_y_rad_s",
                          "gyro_z_rad_s", "gnss_lat_deg", "gnss_lon_deg", "gnss_alt_m", "gnss_vn_m_s",
                          "gnss_ve_m_s", "gnss_vd_m_s", "acc_imu2_x_m_s2", "acc_imu2_y_m_s2",
                          "acc_imu2_z_m_s2", "gyro_imu2_x_rad_s", "gyro_imu2_y_rad_s", "gyro_imu2_z_rad_s",
                          "mag_x_t", "mag_y_t", "mag_z_t", "pressure_pa", "pressure_wing__baro_2_pa"));
  EXPECT_THAT(units, ElementsAre("m/s2", "m/s2", "m/s2", "rad/s", "rad/s", "rad/s", "deg", "deg", "m", "m/s",
                                 "m/s", "m/s", "m/s2", "m/s2", "m/s2", "rad/s", "rad/s", "rad/s", "T", "T",
                                 "T", "Pa", "Pa"));
  EXPECT_EQ(groups[0], "acc");
  EXPECT_EQ(groups[6], "gnss");
  EXPECT_EQ(groups[15], "gyro_imu2");
}

TEST(Sensors, AVehicleWithoutSensorsHasTheSignalsOfItsStates) {
  const VehicleSignals signals = Model().signals();
  EXPECT_TRUE(signals.measured.empty());
  EXPECT_EQ(signals.sensors, signals.states);
  const VehicleSignals more = WithSensors({SensorOf(SensorKind::kAirPressure)}).signals();
  EXPECT_EQ(more.states, signals.states);
  ASSERT_EQ(more.sensors.size(), signals.states.size() + 1);
  EXPECT_EQ(more.sensors[signals.states.size()].name, "pressure_pa");
}

TEST(Sensors, AFallingVehicleFeelsNoForceAndAHoveringOneItsWeight) {
  // At the centre of mass of the whole, where the thrusts' small torques on the base do not count.
  Sensor imu = SensorOf(SensorKind::kImu);
  const VehicleModel model = WithSensors({imu});
  Plant plant(model, {.step_ns = kStep, .ground = false});
  plant.Reset({0, 0, 100}, {0, 0, 0});
  EXPECT_NEAR(Measured(plant, model)[2], 9.81, 1e-12);  // before the first step: held
  const std::vector<double> none(model.signals().inputs.size());
  for (int i = 0; i < 5; ++i) plant.Step(none);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(Measured(plant, model)[i], 0, 1e-6) << i;

  plant.Reset({0, 0, 100}, {model.hover.roll_rad, model.hover.pitch_rad, 0.7});
  for (int i = 0; i < 5; ++i) plant.Step(model.HoverInput());
  const std::vector<double> hover = Measured(plant, model);
  // The weight of a vehicle that hovers with a pitch has a part along x.
  EXPECT_NEAR(hover[0], -9.81 * std::sin(model.hover.pitch_rad), 1e-6);
  EXPECT_NEAR(hover[2], 9.81 * std::cos(model.hover.pitch_rad), 1e-6);
}

TEST(Sensors, ACircleReadsTheCentripetalForceAtTheLeverArm) {
  // The centre of mass rests, the body turns at 5 rad/s about the vertical, and the sensor is 0.2 m off it.
  Sensor imu = SensorOf(SensorKind::kImu);
  imu.p_BS_m = {0.3, 0, 0.05};
  const Vector3d com(0.1, 0, 0);
  const double rate = 5, gravity = 9.81;
  SensorSuite suite({imu}, {.surroundings = {}, .step_ns = kStep, .gravity_m_s2 = gravity}, {});
  const auto motion = [&](double t_s) {
    const Matrix3d R = Eigen::AngleAxisd(rate * t_s, Vector3d::UnitZ()).toRotationMatrix();
    const Vector3d w(0, 0, rate);
    return BaseMotion{-(R * com), w.cross(-(R * com)), w, R};
  };
  suite.Start(motion(0));
  for (int i = 1; i <= 10; ++i) suite.Step(motion(i * kStep_s), com);
  const std::vector<double> read = Readings(suite, 6);
  EXPECT_NEAR(read[0], -rate * rate * 0.2, 1e-9);
  EXPECT_NEAR(read[1], 0, 1e-9);
  EXPECT_NEAR(read[2], gravity, 1e-9);
  EXPECT_NEAR(read[5], rate, 1e-12);
}

TEST(Sensors, SpecificForceOfATumblingBodyIsThatOfItsPath) {
  // The sensor's path is differentiated twice, with steps a hundred times smaller than the plant's.
  const Vector3d com(0.02, -0.03, 0.01), place(0.2, 0.1, -0.15);
  const Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const auto attitude = [](double t) {
    return Matrix3d(Eigen::AngleAxisd(0.8 * std::sin(2 * t), Vector3d::UnitZ()) *
                    Eigen::AngleAxisd(0.5 * std::sin(3 * t), Vector3d::UnitX()));
  };
  const auto position = [](double t) { return Vector3d(std::sin(t), std::cos(2 * t), 0.3 * t * t); };
  const auto rates = [&](double t) {
    constexpr double h = 1e-5;
    const Matrix3d skew = (attitude(t + h) - attitude(t - h)) / (2 * h) * attitude(t).transpose();
    return Vector3d(skew(2, 1), skew(0, 2), skew(1, 0));
  };
  const auto motion = [&](double t) {
    constexpr double h = 1e-5;
    return BaseMotion{position(t), (position(t + h) - position(t - h)) / (2 * h), rates(t), attitude(t)};
  };
  Sensor imu = SensorOf(SensorKind::kImu);
  imu.p_BS_m = place;
  imu.R_BS = turn;
  constexpr TimeNs kShort = 100'000;  // 0.1 ms, so that mean and instant agree
  SensorSuite suite({imu}, {.surroundings = {}, .step_ns = kShort, .gravity_m_s2 = 9.81}, {});
  suite.Start(motion(0));
  double t = 0;
  for (int i = 1; i <= 4000; ++i) suite.Step(motion(t = i * 1e-4), com);
  const auto path = [&](double at) { return Vector3d(position(at) + attitude(at) * place); };
  constexpr double h = 1e-3;
  const Vector3d acceleration = (path(t + h) - 2 * path(t) + path(t - h)) / (h * h);
  const Vector3d force = turn.transpose() * attitude(t).transpose() * (acceleration + Vector3d(0, 0, 9.81));
  const std::vector<double> read = Readings(suite, 6);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(read[i], force[static_cast<Eigen::Index>(i)], 0.005) << i;
  const Vector3d gyro = turn.transpose() * attitude(t).transpose() * rates(t);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(read[3 + i], gyro[static_cast<Eigen::Index>(i)], 1e-9) << i;
}

TEST(Sensors, AMovedCentreOfMassLeavesTheReadingsContinuous) {
  Sensor imu = SensorOf(SensorKind::kImu);
  imu.p_BS_m = {0.1, 0, 0};
  const VehicleModel model = WithSensors({imu});
  Plant plant(model, {.step_ns = kStep, .ground = false});
  std::vector<double> state(model.signals().states.size());
  plant.Reset({0, 0, 50}, {0, 0, 0});
  plant.State(state);
  state[model.signals().states.Find("wz_rad_s").value()] = 2;
  plant.Reset(state);
  const std::vector<double> none(model.signals().inputs.size());
  plant.Step(none);
  Disturbance shifted;
  shifted.com_shift_m = {0, 0.05, 0};
  plant.Step(none, shifted);
  // It falls freely before and after: only the turning is felt, some 0.4 m/s2 at 0.1 m.
  EXPECT_LT(std::abs(Measured(plant, model)[2]), 0.05);
  EXPECT_LT(std::abs(Measured(plant, model)[0]), 1);
}

TEST(Sensors, TheMagneticFieldIsTheWorldsAlongTheSensorsAxes) {
  Sensor compass = SensorOf(SensorKind::kMagnetometer);
  compass.R_BS = Eigen::AngleAxisd(std::numbers::pi, Vector3d::UnitX()).toRotationMatrix();  // FRD
  SensorSuite suite({compass}, {.surroundings = {}, .step_ns = kStep}, {});
  BaseMotion motion = AtRest();
  motion.R_WB = Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::UnitZ()).toRotationMatrix();  // nose north
  suite.Start(motion);
  const std::vector<double> read = Readings(suite, 3);
  EXPECT_NEAR(read[0], 22.8758e-6, 1e-18);  // north is ahead
  EXPECT_NEAR(read[1], 5.5645e-6, 1e-18);   // east is right
  EXPECT_NEAR(read[2], 42.3884e-6, 1e-18);  // down
}

TEST(Surroundings, PressuresOfTheStandard) {
  // U.S. Standard Atmosphere, 1976, Table I, geometric altitude.
  EXPECT_NEAR(StandardPressure_pa(0), 101325, 0.5);
  EXPECT_NEAR(StandardPressure_pa(1000), 89876, 0.5);
  EXPECT_NEAR(StandardPressure_pa(5000), 54048, 0.5);
  EXPECT_NEAR(StandardPressure_pa(10000), 26500, 1);
  EXPECT_NEAR(StandardPressure_pa(15000), 12112, 1);
  EXPECT_NEAR(StandardPressure_pa(-1000), 113930, 10);
}

TEST(Surroundings, APressureSensorHasTheAltitudeOfItsPlace) {
  Sensor baro = SensorOf(SensorKind::kAirPressure);
  baro.p_BS_m = {0, 0, 10};
  baro.altitude_m = 400;
  SensorSuite suite({baro}, {.surroundings = {.elevation_m = 500}, .step_ns = kStep}, {});
  BaseMotion motion = AtRest();
  motion.p_WB_m = {7, 8, 90};
  suite.Start(motion);
  EXPECT_NEAR(Readings(suite, 1)[0], 89876, 0.5);
}

// Geographic to Earth-centred coordinates, in the closed form of the textbook.
Vector3d Ecef(double latitude_deg, double longitude_deg, double height_m) {
  const double a = 6378137, b = 6356752.314245;
  const double lat = latitude_deg * std::numbers::pi / 180, lon = longitude_deg * std::numbers::pi / 180;
  const double n = a * a / std::hypot(a * std::cos(lat), b * std::sin(lat));
  return {(n + height_m) * std::cos(lat) * std::cos(lon), (n + height_m) * std::cos(lat) * std::sin(lon),
          (b * b / (a * a) * n + height_m) * std::sin(lat)};
}

TEST(Surroundings, CoordinatesLieAtTheirDistancesOnTheEllipsoid) {
  for (const double latitude : {-89.0, -33.9, 0.0, 47.4, 60.0})
    for (const double longitude : {-179.9999, 8.5, 120.0}) {
      const EarthFrame earth({.latitude_deg = latitude, .longitude_deg = longitude, .elevation_m = 1234});
      const Vector3d origin = Ecef(latitude, longitude, 1234);
      // Axes by differences: east along the parallel, north along the meridian.
      const auto along = [&](double dlat, double dlon, double dh) {
        return Vector3d((Ecef(latitude + dlat, longitude + dlon, 1234 + dh) -
                         Ecef(latitude - dlat, longitude - dlon, 1234 - dh))
                            .normalized());
      };
      Matrix3d axes;
      axes << along(0, 1e-4, 0), along(1e-4, 0, 0), along(0, 0, 1);
      for (const Vector3d& p :
           {Vector3d(0, 0, 0), Vector3d(500, -800, 300), Vector3d(-900, 0, -20), Vector3d(0, 1000, 5)}) {
        const GeographicPoint at = earth.CoordinatesOf(p);
        const Vector3d back = Ecef(at.latitude_deg, at.longitude_deg, at.altitude_m);
        EXPECT_LT((back - (origin + axes * p)).norm(), 1e-5) << latitude << ' ' << longitude << ' ' << p;
      }
    }
}

TEST(Surroundings, LengthsOfADegree) {
  // WGS 84 at 45 deg: a degree of latitude is 111132 m, one of longitude 78847 m.
  const EarthFrame earth({.latitude_deg = 45, .longitude_deg = 0, .elevation_m = 0});
  const GeographicPoint at = earth.CoordinatesOf({0, 0, 0});
  EXPECT_NEAR(at.latitude_deg, 45, 1e-12);
  EXPECT_NEAR(at.altitude_m, 0, 1e-8);
  EXPECT_NEAR(at.north_m_per_deg, 111132, 1);
  EXPECT_NEAR(at.east_m_per_deg, 78847, 1);
  const GeographicPoint north = earth.CoordinatesOf({0, 100, 0});
  EXPECT_NEAR((north.latitude_deg - 45) * 111132, 100, 0.01);
}

TEST(Surroundings, ASatelliteReceiverReadsNorthEastDown) {
  Sensor gnss = SensorOf(SensorKind::kGnss);
  gnss.p_BS_m = {0.5, 0, 0};
  SensorSuite suite({gnss}, {.surroundings = {}, .step_ns = kStep}, {});
  BaseMotion motion = AtRest();
  motion.p_WB_m = {-0.5, 0, 12};
  motion.v_WB_m_s = {3, 4, 5};
  motion.w_WB_rad_s = {0, 0, 2};
  suite.Start(motion);
  const std::vector<double> read = Readings(suite, 6);
  EXPECT_NEAR(read[0], 47.397742, 1e-9);
  EXPECT_NEAR(read[1], 8.545594, 1e-9);
  EXPECT_NEAR(read[2], 500, 1e-6);
  EXPECT_NEAR(read[3], 5, 1e-6);  // and 1 m/s of turning
  EXPECT_NEAR(read[4], 3, 1e-6);
  EXPECT_NEAR(read[5], -5, 1e-6);
}

// The altitude of a vehicle that climbs 1 m/s, in steps of 4 ms: a clock.
TEST(Sensors, SampleAtTheirRateOnTheGridAndHold) {
  Sensor slow = SensorOf(SensorKind::kGnss, "slow"), late = SensorOf(SensorKind::kGnss, "late"),
         every = SensorOf(SensorKind::kGnss, "every");
  slow.rate_hz = 100;  // at 0, 12, 20, 32, 40 ms
  late.rate_hz = 100;
  late.latency_s = 0.015;
  every.rate_hz = 1000;  // no faster than the plant
  SensorSuite suite({slow, late, every}, {.surroundings = {.elevation_m = 0}, .step_ns = kStep}, {});
  BaseMotion motion = AtRest();
  suite.Start(motion);
  std::vector<int> slow_ms = {0}, late_ms = {0}, every_ms = {0};
  for (int ms = 4; ms <= 60; ms += 4) {
    motion.p_WB_m.z() = ms * 1e-3;
    suite.Step(motion, Vector3d::Zero());
    const std::vector<double> read = Readings(suite, 18);
    const auto altitude_ms = [&](std::size_t at) { return static_cast<int>(std::lround(read[at] * 1e3)); };
    slow_ms.push_back(altitude_ms(2));
    late_ms.push_back(altitude_ms(8));
    every_ms.push_back(altitude_ms(14));
  }
  EXPECT_THAT(slow_ms, ElementsAre(0, 0, 0, 12, 12, 20, 20, 20, 32, 32, 40, 40, 40, 52, 52, 60));
  // A sample of 12 ms comes out at 27 ms, so at the boundary at 28 ms.
  EXPECT_THAT(late_ms, ElementsAre(0, 0, 0, 0, 0, 0, 0, 12, 12, 20, 20, 20, 32, 32, 40, 40));
  EXPECT_THAT(every_ms, ElementsAre(0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, 52, 56, 60));
}

TEST(Sensors, AStartForgetsTheFlightBefore) {
  Sensor imu = SensorOf(SensorKind::kImu);
  imu.rate_hz = 50;
  imu.latency_s = 0.05;
  for (SensorNoise& noise : imu.noise)
    noise = {.stddev = 0.1, .bias_mean = 0.5, .bias_stddev = 1, .walk_density = 0.3, .walk_time_s = 10};
  SensorSuite suite({imu}, {.surroundings = {}, .step_ns = kStep, .gravity_m_s2 = 9.81}, DrawsFrom(3));
  const auto fly = [&] {
    std::vector<double> all;
    suite.Start(AtRest());
    for (int i = 0; i < 200; ++i) {
      suite.Step(AtRest(), Vector3d::Zero());
      const std::vector<double> read = Readings(suite, 6);
      all.insert(all.end(), read.begin(), read.end());
    }
    return all;
  };
  const std::vector<double> first = fly();
  EXPECT_EQ(fly(), first);
  SensorSuite other({imu}, {.surroundings = {}, .step_ns = kStep, .gravity_m_s2 = 9.81}, DrawsFrom(4));
  other.Start(AtRest());
  EXPECT_NE(Readings(other, 6)[0], first[0]);
}

TEST(Sensors, ALatencyOfTooManySamplesIsRefused) {
  Sensor imu = SensorOf(SensorKind::kImu, "imu0");
  imu.latency_s = 10;
  const VehicleModel model = WithSensors({imu});
  EXPECT_NO_THROW(Plant(model, {.step_ns = kStep}));
  EXPECT_THAT([&] { Plant(model, {.step_ns = 10'000}); },
              ::testing::ThrowsMessage<PlantError>(::testing::HasSubstr("'imu0'")));
}

// The overlapping Allan deviation of a record at m times its period.
double AllanDeviation(const std::vector<double>& record, std::size_t m) {
  std::vector<double> sums(record.size() + 1);
  std::partial_sum(record.begin(), record.end(), sums.begin() + 1);
  double total = 0;
  const std::size_t count = record.size() - 2 * m + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const double difference = (sums[i + 2 * m] - 2 * sums[i + m] + sums[i]) / static_cast<double>(m);
    total += difference * difference;
  }
  return std::sqrt(total / 2 / static_cast<double>(count));
}

// `count` samples of the first gyro at 250 Hz, at rest.
std::vector<double> Record(const SensorNoise& noise, std::size_t count, std::uint64_t seed = 1) {
  Sensor imu = SensorOf(SensorKind::kImu);
  imu.noise[3] = noise;
  SensorSuite suite({imu}, {.surroundings = {}, .step_ns = kStep}, DrawsFrom(seed));
  suite.Start(AtRest());
  std::vector<double> record;
  for (std::size_t i = 0; i < count; ++i) {
    suite.Step(AtRest(), Vector3d::Zero());
    record.push_back(Readings(suite, 6)[3]);
  }
  return record;
}

TEST(SensorNoise, WhiteNoiseHasItsAllanDeviation) {
  // N / sqrt(tau), where N = stddev sqrt(period).
  const std::vector<double> record = Record({.stddev = 0.01}, 200'000);
  for (const std::size_t m : {1U, 10U, 100U})
    EXPECT_NEAR(AllanDeviation(record, m) / (0.01 * std::sqrt(1.0 / static_cast<double>(m))), 1, 0.05) << m;
  EXPECT_NEAR(std::accumulate(record.begin(), record.end(), 0.0) / 200'000, 0, 4 * 0.01 / std::sqrt(2e5));
}

TEST(SensorNoise, ARandomWalkHasItsAllanDeviation) {
  // K sqrt(tau / 3), where K is the density.
  const std::vector<double> record = Record({.walk_density = 0.02}, 400'000);
  for (const std::size_t m : {25U, 250U}) {
    const double tau_s = static_cast<double>(m) * kStep_s;
    EXPECT_NEAR(AllanDeviation(record, m) / (0.02 * std::sqrt(tau_s / 3)), 1, 0.08) << m;
  }
}

TEST(SensorNoise, ASlowBiasHasItsVarianceAndCorrelationAtAnyRate) {
  // Gauss-Markov: variance sigma^2 T / 2, correlation exp(-dt / T). The period is half of T, so Euler steps would miss
  // both.
  Sensor imu = SensorOf(SensorKind::kImu);
  imu.rate_hz = 25;
  imu.noise[0] = {.walk_density = 3, .walk_time_s = 0.08};
  SensorSuite suite({imu}, {.surroundings = {}, .step_ns = 40 * kNsPerMs}, DrawsFrom(9));
  suite.Start(AtRest());
  double sum2 = 0, product = 0, last = 0;
  constexpr int kCount = 200'000;
  for (int i = 0; i < kCount; ++i) {
    suite.Step(AtRest(), Vector3d::Zero());
    const double value = Readings(suite, 6)[0];
    sum2 += value * value;
    product += value * last;
    last = value;
  }
  EXPECT_NEAR(sum2 / kCount / (9 * 0.08 / 2), 1, 0.03);
  EXPECT_NEAR(product / sum2, std::exp(-0.5), 0.01);
}

TEST(SensorNoise, AConstantBiasIsDrawnOnceAndAMeanIsAdded) {
  double sum = 0, sum2 = 0;
  constexpr int kFlights = 2000;
  for (int seed = 0; seed < kFlights; ++seed) {
    const std::vector<double> record =
        Record({.mean = 0.5, .bias_mean = 2, .bias_stddev = 0.1}, 3, static_cast<std::uint64_t>(seed));
    EXPECT_EQ(record[0], record[2]);
    sum += record[0];
    sum2 += record[0] * record[0];
  }
  const double mean = sum / kFlights;
  EXPECT_NEAR(mean, 2.5, 4 * 0.1 / std::sqrt(kFlights));
  EXPECT_NEAR(std::sqrt(sum2 / kFlights - mean * mean), 0.1, 0.01);
}

TEST(SensorNoise, AQuantisedReadingIsAMultiple) {
  const std::vector<double> record = Record({.stddev = 1, .quantum = 0.25}, 100);
  for (const double value : record) EXPECT_EQ(value * 4, std::round(value * 4));
}

TEST(SensorNoise, APositionsNoiseIsInMetres) {
  Sensor gnss = SensorOf(SensorKind::kGnss);
  gnss.noise[0].stddev = gnss.noise[1].stddev = 1.5;
  SensorSuite suite({gnss}, {.surroundings = {}, .step_ns = kStep}, DrawsFrom(2));
  suite.Start(AtRest());
  double north2 = 0, east2 = 0, product = 0;
  constexpr int kCount = 20'000;
  for (int i = 0; i < kCount; ++i) {
    suite.Step(AtRest(), Vector3d::Zero());
    const std::vector<double> read = Readings(suite, 6);
    // Distances on the ellipsoid, by the test's own conversion.
    const Vector3d d = Ecef(read[0], read[1], 488) - Ecef(47.397742, 8.545594, 488);
    const Vector3d east(-std::sin(8.545594 * std::numbers::pi / 180),
                        std::cos(8.545594 * std::numbers::pi / 180), 0);
    const double e = d.dot(east), n = std::copysign(std::sqrt(d.squaredNorm() - e * e), d.z());
    north2 += n * n;
    east2 += e * e;
    product += n * e;
  }
  EXPECT_NEAR(std::sqrt(north2 / kCount), 1.5, 0.03);
  EXPECT_NEAR(std::sqrt(east2 / kCount), 1.5, 0.03);
  EXPECT_LT(std::abs(product / kCount), 0.06);  // each axis draws by itself
}

}  // namespace
}  // namespace tiltproof::plant
