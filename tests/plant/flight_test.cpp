// The plant flown against the second model (Lagrange, fourth-order Runge-Kutta), open loop and on the paper's
// spiral.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "plant/lqr_design.h"
#include "plant/plant.h"
#include "tests/plant/models.h"
#include "tests/support/control_period.h"
#include "tests/support/lagrange_model.h"
#include "tests/support/reference_controller.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

using testing::LagrangeModel;
using testing::LagrangeParameters;
using testing::ReferenceController;
using testing::ReferenceGain;
using testing::Spiral;
using testing::TiltrotorPlant;

constexpr double kPeriod_s = 0.012;
constexpr int kSpiralPeriods = 5000;  // 60 s
constexpr ActuatorsTruth kPaperFeedForward = {10.2751, 10.2799, 0, 0};

ReferenceGain PublishedGain() {
  return testing::ReadGainCsv(SourceFile("tests/golden/dlqr_gain_published.csv"));
}

ReferenceGain ToRows(const GainMatrix& gain) {
  ReferenceGain rows{};
  for (int i = 0; i < gain.rows(); ++i) {
    for (int j = 0; j < gain.cols(); ++j)
      rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = gain(i, j);
  }
  return rows;
}

LagrangeModel::State StartOfSpiral(const Hover& hover) {
  LagrangeModel::State state;
  state.q << 2, 0, 0.5, 0, 0, 0, hover.hinge_rad[0], hover.hinge_rad[1];
  return state;
}

// States at every control period, before its input; and the inputs.
struct Flight {
  std::vector<SensorsTruth> states;
  std::vector<ActuatorsTruth> inputs;
  double hinge_gap_m = 0;
  FlightEvent event = FlightEvent::kNone;
};

Flight FlySpiral(const VehicleModel& model, const ReferenceGain& gain, const ActuatorsTruth& feed_forward,
                 TimeNs step_ns, bool velocity, RatesFrame rates = RatesFrame::kWorld) {
  TiltrotorPlant plant(model, {.step_ns = step_ns});
  plant.Reset({2, 0, 0.5}, {0, 0, 0});
  ReferenceController controller(gain, feed_forward);
  Flight flight;
  for (int k = 0; k < kSpiralPeriods && flight.event == FlightEvent::kNone; ++k) {
    flight.states.push_back(plant.State());
    const ActuatorsTruth input = controller.Step(plant.State(rates), Spiral(k * kPeriod_s, velocity));
    flight.inputs.push_back(input);
    for (TimeNs t = 0; t < kControlPeriodNs; t += step_ns) plant.Step(input);
    flight.hinge_gap_m = std::max(flight.hinge_gap_m, plant.HingeGap());
    flight.event = plant.Event();
  }
  return flight;
}

Flight FlySpiralWithSecondModel(const LagrangeParameters& parameters, const Hover& hover,
                                const ReferenceGain& gain, const ActuatorsTruth& feed_forward, bool velocity,
                                RatesFrame rates = RatesFrame::kWorld) {
  const LagrangeModel model(parameters);
  LagrangeModel::State state = StartOfSpiral(hover);
  ReferenceController controller(gain, feed_forward);
  Flight flight;
  for (int k = 0; k < kSpiralPeriods; ++k) {
    flight.states.push_back(ToSensors(state));
    const SensorsTruth sensed =
        rates == RatesFrame::kEuler ? ToSensorsWithEulerRates(state) : flight.states.back();
    const ActuatorsTruth input = controller.Step(sensed, Spiral(k * kPeriod_s, velocity));
    flight.inputs.push_back(input);
    // 2 ms: its error is far below the plant's (StepOfTheSecondModelIsShortEnough).
    for (int i = 0; i < 6; ++i) model.Advance(input, kPeriod_s / 6, state);
  }
  return flight;
}

double PositionDifferenceMax(const Flight& a, const Flight& b) {
  double largest = a.states.size() == b.states.size() ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < std::min(a.states.size(), b.states.size()); ++k) {
    const SensorsTruth &p = a.states[k], &q = b.states[k];
    largest = std::max(largest, std::hypot(p.x_m - q.x_m, p.y_m - q.y_m, p.z_m - q.z_m));
  }
  return largest;
}

struct Tracking {
  std::array<double, 3> rmse_m{}, error_max_m{};
  double rmse_3d_m() const { return std::hypot(rmse_m[0], rmse_m[1], rmse_m[2]); }
};
Tracking Track(const Flight& flight, double from_s) {
  Tracking tracking;
  int count = 0;
  for (std::size_t k = 0; k < flight.states.size(); ++k) {
    const double t_s = static_cast<double>(k) * kPeriod_s;
    if (t_s < from_s) continue;
    const SensorsTruth& s = flight.states[k];
    const ReferenceTruth r = Spiral(t_s, false);
    const std::array<double, 3> error = {s.x_m - r.x_m, s.y_m - r.y_m, s.z_m - r.z_m};
    for (std::size_t i = 0; i < 3; ++i) {
      tracking.rmse_m[i] += error[i] * error[i];
      tracking.error_max_m[i] = std::max(tracking.error_max_m[i], std::abs(error[i]));
    }
    ++count;
  }
  for (double& rmse : tracking.rmse_m) rmse = std::sqrt(rmse / count);
  return tracking;
}

// Five percent, and what the last printed digit leaves open.
void ExpectClose(const std::array<double, 3>& measured, const std::array<double, 3>& expected, double digit,
                 const char* what) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(measured[i], expected[i], 0.05 * expected[i] + 0.5 * digit) << what << " of axis " << i;
  }
}

struct Extremes {
  std::array<double, 3> angle_deg{};
  double force_min_n = std::numeric_limits<double>::infinity(), force_max_n = -force_min_n;
};
Extremes FindExtremes(const Flight& flight) {
  Extremes extremes;
  for (const SensorsTruth& s : flight.states) {
    const std::array<double, 3> angles = {s.roll_rad, s.pitch_rad, s.yaw_rad};
    for (std::size_t i = 0; i < 3; ++i) {
      extremes.angle_deg[i] = std::max(extremes.angle_deg[i], std::abs(angles[i]) * 180 / std::numbers::pi);
    }
  }
  for (const ActuatorsTruth& u : flight.inputs) {
    extremes.force_min_n = std::min({extremes.force_min_n, u.f_r_n, u.f_l_n});
    extremes.force_max_n = std::max({extremes.force_max_n, u.f_r_n, u.f_l_n});
  }
  return extremes;
}

// The figures that independent prototypes of plant and controller gave; their sensors sent Euler rates, the
// derivatives of the coordinates that the law was designed in.
TEST(Spiral, WithEulerRatesAndPositionReferenceTracksAsThePrototypes) {
  const Flight flight = FlySpiral(LoadShipped("tiltrotor"), PublishedGain(), kPaperFeedForward, 4 * kNsPerMs,
                                  false, RatesFrame::kEuler);
  ASSERT_EQ(flight.event, FlightEvent::kNone);
  ExpectClose(Track(flight, 0).rmse_m, {.171, .390, .044}, 1e-3, "RMSE");
  ExpectClose(Track(flight, 0).error_max_m, {.288, 1.169, .251}, 1e-3, "largest error");
  ExpectClose(Track(flight, 10).rmse_m, {.174, .360, .0009}, 1e-4, "RMSE after 10 s");
  const Extremes extremes = FindExtremes(flight);
  ExpectClose(extremes.angle_deg, {16.4, 9.6, 10.0}, 0.1, "largest angle");
  EXPECT_NEAR(extremes.force_min_n, 10.14, 0.05);
  EXPECT_NEAR(extremes.force_max_n, 11.00, 0.05);
}

TEST(Spiral, WithEulerRatesAndVelocityReferenceTracksAsThePrototypes) {
  const Flight flight = FlySpiral(LoadShipped("tiltrotor"), PublishedGain(), kPaperFeedForward, 4 * kNsPerMs,
                                  true, RatesFrame::kEuler);
  ASSERT_EQ(flight.event, FlightEvent::kNone);
  ExpectClose(Track(flight, 0).rmse_m, {.021, .109, .045}, 1e-3, "RMSE");
  ExpectClose(Track(flight, 0).error_max_m, {.141, .648, .217}, 1e-3, "largest error");
  ExpectClose(Track(flight, 10).rmse_m, {.015, .048, .0008}, 1e-4, "RMSE after 10 s");
  const Extremes extremes = FindExtremes(flight);
  ExpectClose(extremes.angle_deg, {24.7, 12.1, 12.4}, 0.1, "largest angle");
  EXPECT_NEAR(extremes.force_min_n, 9.09, 0.05);
  EXPECT_NEAR(extremes.force_max_n, 12.15, 0.05);
}

// World rates, which the authors' server sends, fly as well; only the first swing differs.
TEST(Spiral, WithWorldRatesTracksTheSameOnceSettled) {
  const VehicleModel model = LoadShipped("tiltrotor");
  const Flight position = FlySpiral(model, PublishedGain(), kPaperFeedForward, 4 * kNsPerMs, false);
  ASSERT_EQ(position.event, FlightEvent::kNone);
  ExpectClose(Track(position, 0).rmse_m, {.171, .390, .044}, 1e-3, "RMSE");
  ExpectClose(Track(position, 10).rmse_m, {.174, .360, .0009}, 1e-4, "RMSE after 10 s");
  const Flight velocity = FlySpiral(model, PublishedGain(), kPaperFeedForward, 4 * kNsPerMs, true);
  ASSERT_EQ(velocity.event, FlightEvent::kNone);
  ExpectClose(Track(velocity, 10).rmse_m, {.015, .048, .0008}, 1e-4, "RMSE after 10 s");
  EXPECT_LE(velocity.hinge_gap_m, 1e-4);
}

TEST(Spiral, AgreesWithTheSecondModel) {
  const VehicleModel model = LoadShipped("tiltrotor");
  for (const RatesFrame rates : {RatesFrame::kWorld, RatesFrame::kEuler}) {
    const Flight truth = FlySpiralWithSecondModel(testing::DesignPlant(), model.hover, PublishedGain(),
                                                  kPaperFeedForward, true, rates);
    const auto difference_m = [&](TimeNs step_ns) {
      return PositionDifferenceMax(FlySpiral(model, PublishedGain(), kPaperFeedForward, step_ns, true, rates),
                                   truth);
    };
    const double coarse_m = difference_m(4 * kNsPerMs), fine_m = difference_m(kNsPerMs);
    const std::string name = rates == RatesFrame::kWorld ? "world" : "euler";
    RecordProperty("difference_4ms_m_" + name, std::to_string(coarse_m));
    RecordProperty("difference_1ms_m_" + name, std::to_string(fine_m));
    EXPECT_LT(coarse_m, 6e-3);
    EXPECT_LT(fine_m, 1.6e-3);
    // First order: a quarter of the step, a quarter of the error.
    EXPECT_NEAR(coarse_m / fine_m, 4, 0.5);
  }
}

TEST(Spiral, StepOfTheSecondModelIsShortEnough) {
  const VehicleModel model = LoadShipped("tiltrotor");
  const LagrangeModel lagrange(testing::DesignPlant());
  ReferenceController controller(PublishedGain(), kPaperFeedForward);
  LagrangeModel::State coarse = StartOfSpiral(model.hover), fine = coarse;
  for (int k = 0; k < 250; ++k) {
    const ActuatorsTruth input = controller.Step(ToSensors(fine), Spiral(k * kPeriod_s, true));
    for (int i = 0; i < 6; ++i) lagrange.Advance(input, 2e-3, coarse);
    for (int i = 0; i < 48; ++i) lagrange.Advance(input, 0.25e-3, fine);
  }
  EXPECT_LT((coarse.q - fine.q).head<3>().norm(), 1e-6);
}

TEST(OpenLoop, AgreesWithTheSecondModel) {
  struct Case {
    const char* name;
    LagrangeParameters parameters;
  };
  for (const Case& each :
       {Case{"tiltrotor", testing::DesignPlant()}, Case{"tiltrotor_published", testing::PublishedPlant()}}) {
    const VehicleModel model = LoadShipped(each.name);
    const LagrangeModel lagrange(each.parameters);
    const auto difference = [&](TimeNs step_ns) {
      TiltrotorPlant plant(model, {.step_ns = step_ns});
      plant.Reset({0, 0, 5}, {0.1, -0.1, 0.3});
      LagrangeModel::State state;
      state.q << 0, 0, 5, 0.1, -0.1, 0.3, model.hover.hinge_rad[0], model.hover.hinge_rad[1];
      for (int k = 0; k < 80; ++k) {  // 0.96 s
        ActuatorsTruth input = testing::ActuatorsOf(model.HoverInput());
        input.f_r_n += 0.5 * std::sin(0.3 * k);
        input.f_l_n -= 0.3 * std::cos(0.2 * k);
        input.tau_r_nm += 2e-4 * std::sin(0.4 * k);
        input.tau_l_nm -= 2e-4 * std::cos(0.4 * k);
        for (TimeNs t = 0; t < kControlPeriodNs; t += step_ns) plant.Step(input);
        for (int i = 0; i < 12; ++i) lagrange.Advance(input, 1e-3, state);
      }
      const SensorsTruth ode = plant.State(), exact = testing::ToSensors(state);
      double largest = 0;
      for (std::size_t i = 0; i < 8; ++i) {  // positions and angles
        largest =
            std::max(largest, std::abs(ode.*kSensorFields[i].in_double - exact.*kSensorFields[i].in_double));
      }
      return largest;
    };
    const double at_4ms = difference(4 * kNsPerMs), at_1ms = difference(kNsPerMs),
                 at_100us = difference(100 * kNsPerUs);
    EXPECT_LT(at_4ms, 0.03) << each.name;
    EXPECT_LT(at_1ms, 0.35 * at_4ms) << each.name;
    EXPECT_LT(at_100us, 0.15 * at_1ms) << each.name;
    EXPECT_LT(at_100us, 1e-3) << each.name;
  }
}

TEST(AsPublishedPlant, PublishedGainLosesIt) {
  VehicleModel model = LoadShipped("tiltrotor_published");
  for (Hinge& hinge : model.hinges) hinge.torque_max_nm = 1e3;
  const Flight flight = FlySpiral(model, PublishedGain(), kPaperFeedForward, 4 * kNsPerMs, true);
  EXPECT_NE(flight.event, FlightEvent::kNone);
}

TEST(AsPublishedPlant, RedesignFliesIt) {
  const VehicleModel model = LoadShipped("tiltrotor_published");
  const LqrDesign design = DesignLqr(model);
  const Flight flight =
      FlySpiral(model, ToRows(design.gain), testing::ActuatorsOf(design.hover.input), 4 * kNsPerMs, true);
  ASSERT_EQ(flight.event, FlightEvent::kNone);
  EXPECT_NEAR(Track(flight, 10).rmse_3d_m(), 0.05, 0.005);
  EXPECT_LE(flight.hinge_gap_m, 1e-4);
  const Flight truth = FlySpiralWithSecondModel(testing::PublishedPlant(), model.hover, ToRows(design.gain),
                                                testing::ActuatorsOf(design.hover.input), true);
  EXPECT_LT(PositionDifferenceMax(flight, truth), 8e-3);
}

}  // namespace
}  // namespace tiltproof::plant
