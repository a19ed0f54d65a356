// `tolerant` and `paper` fly the same faults on another vehicle than the model's, with noise on all sensors. The
// vehicle is the firmware's equations of motion with other numbers; a line without byte time joins the two.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <random>

#include "firmware/builds.h"
#include "firmware/flight_application.h"
#include "firmware/messages.h"
#include "firmware/tolerant/vehicle_dynamics.h"
#include "link/frame.h"
#include "tests/firmware/ordinary_noise.h"

namespace tiltproof::firmware {
namespace {

constexpr double kDuration_s = 30;

// Mass, inertia and drag torque against the model's.
struct Change {
  double mass, inertia, drag;
};
constexpr Change kSame = {1, 1, 1};
constexpr Change kHeavy = {1.02, 1.10, 1.20};
constexpr Change kLight = {0.98, 0.90, 0.80};

VehicleConstants Changed(const Change& change) {
  VehicleParameters vehicle = kTiltrotor;
  vehicle.mass_kg *= change.mass;
  for (double& entry : vehicle.inertia_kg_m2) entry *= change.inertia;
  for (Thruster& thruster : vehicle.thrusters) {
    thruster.mass_kg *= change.mass;
    for (double& entry : thruster.inertia_kg_m2) entry *= change.inertia;
  }
  vehicle.drag_ratio_m *= change.drag;
  return ComputeVehicleConstants(vehicle);
}

Reference Circle(double t_s) {
  constexpr double kRate = 0.314;
  return {.x_m = static_cast<float>(5 * std::cos(kRate * t_s) - 5),
          .y_m = static_cast<float>(5 * std::sin(kRate * t_s)),
          .z_m = static_cast<float>(1 + t_s / 6),
          .yaw_rad = 0,
          .vx_m_s = static_cast<float>(-5 * kRate * std::sin(kRate * t_s)),
          .vy_m_s = static_cast<float>(5 * kRate * std::cos(kRate * t_s)),
          .vz_m_s = 1.0F / 6};
}

using Sense = std::function<void(double t_s, Sensors& sensed)>;

// The board and the server in one: answers requests from the vehicle, applies commands at the next step.
class Flight final : public Port {
 public:
  Flight(const char* build, const Change& change, Sense sense)
      : vehicle_(Changed(change)), sense_(std::move(sense)), firmware_(*FindBuild(build), kDialect, *this) {
    const Reference start = Circle(0);
    state_ = ToMotion({.x_m = start.x_m,
                       .y_m = start.y_m,
                       .z_m = start.z_m,
                       .pitch_rad = -0.0117F,
                       .alpha_r_rad = 0.0116F,
                       .alpha_l_rad = 0.0116F});
  }

  // The largest distance to the path from 10 s on; infinite when it falls over.
  double Fly() {
    double worst_m = 0;
    TimeNs wake = firmware_.Start(0);
    for (std::int64_t step = 0; t_s_ < kDuration_s; ++step) {
      const TimeNs now = step * kModelStepNs;
      t_s_ = ToSeconds(now);
      if (step % 3 == 0) {
        const link::MessageBytes message = link::EncodeReference(Circle(t_s_));
        std::array<std::uint8_t, link::FrameBytesMax(link::kReferenceMessageBytes)> wire;
        firmware_.Receive(Uart::kReference, link::EncodeFrame(message.span(), wire).bytes);
      }
      for (bool more = true; more;) {
        more = false;
        if (wake <= now + kModelStepNs / 2) wake = firmware_.Tick(std::max(now, wake));
        if (!asked_) continue;
        asked_ = false;
        Answer();
        wake = firmware_.Tick(now);
        more = true;
      }
      StepMotion(vehicle_, inputs_, state_);
      const Sensors truth = ToSensors(state_);
      const Reference there = Circle(t_s_ + ToSeconds(kModelStepNs));
      if (!(std::abs(truth.roll_rad) < 0.8F && std::abs(truth.pitch_rad) < 0.8F)) return INFINITY;
      if (t_s_ >= 10)
        worst_m = std::max<double>(
            worst_m, std::hypot(truth.x_m - there.x_m, truth.y_m - there.y_m, truth.z_m - there.z_m));
    }
    return worst_m;
  }
  Status status() const { return firmware_.status(); }

 private:
  static constexpr link::Dialect kDialect = link::Dialect::kPaper;

  void Answer() {
    Sensors sensed = ToSensors(state_);
    for (std::size_t i = 0; i < kSensorCount; ++i)
      sensed.*kSensorFields[i].in_float += kOrdinaryNoise[i] * NearlyNormal(engine_);
    sense_(t_s_, sensed);
    const link::MessageBytes message = link::EncodeSensors(sensed);
    std::array<std::uint8_t, link::FrameBytesMax(link::kSensorMessageBytes)> wire;
    firmware_.Receive(Uart::kMain, link::EncodeFrame(message.span(), wire).bytes);
  }
  TimeNs Transmit(Uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    link::FrameDecoder decoder;
    while (const auto event = decoder.Next(bytes)) {
      link::ClientMessage message;
      if (link::DecodeClientMessage(kDialect, event->payload, message) != link::MessageStatus::kOk) continue;
      asked_ = asked_ || message.read_sensors;
      if (message.has_actuators) inputs_ = message.actuators;
    }
    return now;
  }
  void Log(TimeNs, const char*) override {}

  VehicleConstants vehicle_;
  Sense sense_;
  FlightApplication firmware_;
  MotionState state_;
  Actuators inputs_{.f_r_n = 10.27F, .f_l_n = 10.28F, .tau_r_nm = 0, .tau_l_nm = 0};
  double t_s_ = 0;
  bool asked_ = false;
  std::mt19937 engine_{1};
};

double ErrorOf(const char* build, const Change& change, const Sense& sense) {
  return Flight(build, change, sense).Fly();
}

// No false substitution: all that differs are the commands that follow a surprising sample in the same period.
TEST(TolerantFlightTest, OnAGoodLineItFliesAsThePaperDoesWhateverTheVehicle) {
  for (const Change& change : {kSame, kHeavy, kLight}) {
    const auto good = [](double, Sensors&) {};
    const double paper_m = ErrorOf("paper", change, good);
    EXPECT_LT(paper_m, 0.3) << change.mass;
    EXPECT_NEAR(ErrorOf("tolerant", change, good), paper_m, 1e-3) << change.mass;
  }
}

struct SensorFault {
  const char* name;
  Sense sense;
};
// From 12 to 17 s.
Sense During(const Sense& sense) {
  return [sense](double t_s, Sensors& sensed) {
    if (t_s >= 12 && t_s < 17) sense(t_s - 12, sensed);
  };
}
const std::vector<SensorFault>& SensorFaults() {
  static const std::vector<SensorFault> faults = {
      {"x bias", During([](double, Sensors& s) { s.x_m += 3; })},
      {"z stuck", During([](double, Sensors& s) { s.z_m = 0; })},
      {"y drift", During([](double since_s, Sensors& s) { s.y_m += static_cast<float>(0.5 * since_s); })},
      {"roll bias", During([](double, Sensors& s) { s.roll_rad += 0.6F; })},
      {"pitch scale", During([](double, Sensors& s) { s.pitch_rad *= -10; })},
      {"yaw not a number", During([](double, Sensors& s) { s.yaw_rad = std::nanf(""); })},
      {"hinge bias", During([](double, Sensors& s) { s.alpha_r_rad += 1.5F; })},
      {"vx bias", During([](double, Sensors& s) { s.vx_m_s += 4; })},
      {"wx bias", During([](double, Sensors& s) { s.wx_rad_s += 3; })},
      {"wz not a number", During([](double, Sensors& s) { s.wz_rad_s = std::nanf(""); })},
      {"position mirrored", During([](double, Sensors& s) {
         s.x_m = -s.x_m;
         s.y_m = -s.y_m;
       })},
  };
  return faults;
}

TEST(TolerantFlightTest, OneLyingSensorIsFlownWithoutOnEveryVehicle) {
  for (const SensorFault& fault : SensorFaults()) {
    for (const Change& change : {kSame, kHeavy, kLight}) {
      EXPECT_LT(ErrorOf("tolerant", change, fault.sense), 0.5) << fault.name << " " << change.mass;
    }
    // The fault is one: without tolerance it is felt.
    EXPECT_GT(ErrorOf("paper", kSame, fault.sense), 0.5) << fault.name;
  }
}

// Small lies and slow lies, which are hard to tell from a wind: the path is kept to 0.6 m at least, where margins
// allow 1 m.
TEST(TolerantFlightTest, WhatThePaperSurvivesItSurvivesToo) {
  for (std::size_t signal = 0; signal < kSensorCount; ++signal) {
    for (const float share : {0.3F, 1.0F, 3.0F}) {
      for (const bool drifts : {false, true}) {
        const Sense sense = During([&](double since_s, Sensors& s) {
          const float size = share * (signal < 8 ? 0.1F : 0.3F);
          s.*kSensorFields[signal].in_float += drifts ? size * static_cast<float>(since_s) / 2 : size;
        });
        for (const Change& change : {kSame, kHeavy, kLight}) {
          const double paper_m = ErrorOf("paper", change, sense);
          if (paper_m > 1) continue;
          EXPECT_LT(ErrorOf("tolerant", change, sense), std::max(1.25 * paper_m, 0.6))
              << kSensorFields[signal].column << " " << share << (drifts ? " drift " : " bias ")
              << change.mass << ", paper " << paper_m;
        }
      }
    }
  }
}

TEST(TolerantFlightTest, ALyingSensorIsDegradedNotFailsafe) {
  Flight flight("tolerant", kSame, [](double t_s, Sensors& s) {
    if (t_s >= 28) s.x_m += 3;
  });
  flight.Fly();
  EXPECT_EQ(flight.status().state, SupervisorState::kDegraded);
  EXPECT_EQ(flight.status().failsafe_count, 0U);
}

}  // namespace
}  // namespace tiltproof::firmware
