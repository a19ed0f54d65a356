// Each firmware flies a simple model of the vehicle through its own bytes: over an ideal line, and over one
// at 921600 baud whose delay is part of the loop. How well it tracks the real plant is for the harness to
// measure; here it must fly, and come back from a push.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/firmware/fake_board.h"
#include "tests/firmware/simple_vehicle.h"
#include "tests/support/control_period.h"

namespace tiltproof::firmware {
namespace {

struct Case {
  const char* name;
  const char* library;
  const char* firmware;
  bool byte_time;
  double spiral_error_m;  // largest allowed for t >= 10 s
};

class ClosedLoopTest : public ::testing::TestWithParam<Case> {
 protected:
  using Path = ReferenceTruth (*)(double t_s);

  // Largest distance to the path from `settled_s` on.
  double Fly(Path path, double duration_s, double settled_s, double push_m_s) {
    const ClientLibrary library(GetParam().library);
    FakeBoard board(library, GetParam().firmware, "paper");
    const ReferenceTruth start = path(0);
    SimpleVehicle vehicle(start.x_m, start.y_m, start.z_m);
    ActuatorsTruth input{10.2751, 10.2799, 0, 0};
    double error_max_m = 0;
    board.Start(0);
    board.TakeSent();
    const auto periods = static_cast<int>(duration_s / 0.012);
    for (int k = 0; k < periods; ++k) {
      const double t_s = 0.012 * k;
      const TimeNs tick = k * kControlPeriodNs;
      if (k == 100) vehicle.Push(push_m_s);
      board.Grant(tick);
      board.Receive(tick, FrameOf(path(t_s), kReferenceFields), TILTPROOF_UART_REFERENCE);
      board.TakeSent();
      // On a line with byte time the reply is there 0.8 ms after the tick and the input takes force 0.2 ms
      // later.
      const TimeNs reply = tick + (GetParam().byte_time ? 825 * kNsPerUs : 0);
      board.Receive(reply, FrameOf(vehicle.state(), kSensorFields));
      const std::vector<Sent> sent = board.TakeSent();
      if (sent.size() != 1) throw std::runtime_error("no command in this period");
      const std::vector<float> command = FrameValues(sent[0].bytes);
      const ActuatorsTruth next{command.at(1), command.at(2), command.at(3), command.at(4)};
      const int in_force_ms = GetParam().byte_time ? 4 : 0;
      for (int ms = 0; ms < 12; ++ms) {
        if (ms == in_force_ms) input = next;
        vehicle.Step(input, 0.001);
      }
      const ReferenceTruth r = path(t_s + 0.012);
      const SensorsTruth& s = vehicle.state();
      if (t_s >= settled_s) {
        error_max_m = std::max(error_max_m, std::hypot(s.x_m - r.x_m, s.y_m - r.y_m, s.z_m - r.z_m));
      }
      if (!(std::abs(s.roll_rad) < 1 && std::abs(s.pitch_rad) < 1)) return INFINITY;
    }
    return error_max_m;
  }

 private:
  template <class Group, class Fields>
  static Bytes FrameOf(const Group& group, const Fields& fields) {
    std::vector<float> values;
    for (const auto& field : fields) values.push_back(static_cast<float>(group.*field.in_double));
    return Frame(values);
  }
};

constexpr double kOwnError_m = 0.25;
constexpr double kMinimalError_m = 0.40;
INSTANTIATE_TEST_SUITE_P(
    Firmware, ClosedLoopTest,
    ::testing::Values(Case{"paper_ideal", TILTPROOF_FIRMWARE_LIBRARY, "paper", false, kOwnError_m},
                      Case{"paper_wire", TILTPROOF_FIRMWARE_LIBRARY, "paper", true, kOwnError_m},
                      Case{"tolerant_wire", TILTPROOF_FIRMWARE_LIBRARY, "tolerant", true, kOwnError_m},
                      Case{"minimal_c_ideal", MINIMAL_FIRMWARE_LIBRARY, "minimal", false, kMinimalError_m},
                      Case{"minimal_c_wire", MINIMAL_FIRMWARE_LIBRARY, "minimal", true, kMinimalError_m}),
    [](const auto& flight) { return flight.param.name; });

TEST_P(ClosedLoopTest, HoversAndComesBackFromAPush) {
  const auto hover = [](double) { return ReferenceTruth{1, 2, 3, 0, 0, 0, 0}; };
  EXPECT_GT(Fly(hover, 3, 0, 1.0), 0.1);  // the push is felt
  const double error_m = Fly(hover, 40, 30, 1.0);
  RecordProperty("error_m", std::to_string(error_m));
  EXPECT_LT(error_m, 0.02);
}

// Equation (1) of the paper: 3 turns of 5 m radius, 10 m up, in 60 s.
TEST_P(ClosedLoopTest, FliesTheSpiral) {
  const auto spiral = [](double t_s) {
    const double w = 2 * 3 * std::numbers::pi / 60;
    return ReferenceTruth{5 * std::cos(w * t_s) - 5 + 2,
                          5 * std::sin(w * t_s),
                          10 * t_s / 60 + 0.5,
                          0,
                          -5 * w * std::sin(w * t_s),
                          5 * w * std::cos(w * t_s),
                          10.0 / 60};
  };
  const double error_m = Fly(spiral, 60, 10, 0);
  RecordProperty("error_m", std::to_string(error_m));
  EXPECT_LT(error_m, GetParam().spiral_error_m);
}

}  // namespace
}  // namespace tiltproof::firmware
