// Signals that lie in every way, alone, against a known motion: what comes out is near the truth, and nothing else is
// touched. The truth is sinusoids; angular rates along the world's axes come from it by matrices of its own.
#include "firmware/tolerant/signal_screen.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "firmware/messages.h"
#include "tests/firmware/ordinary_noise.h"

namespace tiltproof::firmware {
namespace {

constexpr double kPeriod_s = 0.012;

struct Sine {
  double amplitude, rad_s, phase;
  double At(double t_s) const { return amplitude * std::sin(rad_s * t_s + phase); }
  double RateAt(double t_s) const { return amplitude * rad_s * std::cos(rad_s * t_s + phase); }
};
// x, y, z, roll, pitch, yaw, the hinges.
constexpr std::array<Sine, 8> kMotion = {{{5, 0.314, 0.3},
                                          {5, 0.314, 1.9},
                                          {1, 0.2, 0},
                                          {0.15, 1.3, 0.2},
                                          {0.1, 1.1, 1},
                                          {0.1, 0.7, 2},
                                          {0.15, 1.7, 0},
                                          {0.15, 1.5, 1}}};

using Array = std::array<double, 16>;
Array TruthAt(double t_s) {
  Array truth;
  for (std::size_t i = 0; i < 8; ++i) {
    truth[i] = kMotion[i].At(t_s);
    truth[8 + i] = kMotion[i].RateAt(t_s);
  }
  const double roll_rate = truth[11], pitch_rate = truth[12], yaw_rate = truth[13];
  const double pitch = truth[4], yaw = truth[5];
  truth[11] = std::cos(yaw) * std::cos(pitch) * roll_rate - std::sin(yaw) * pitch_rate;
  truth[12] = std::sin(yaw) * std::cos(pitch) * roll_rate + std::cos(yaw) * pitch_rate;
  truth[13] = yaw_rate - std::sin(pitch) * roll_rate;
  return truth;
}

Sensors ToSensorsOf(const Array& values) {
  Sensors sensors;
  for (std::size_t i = 0; i < 16; ++i) sensors.*kSensorFields[i].in_float = static_cast<float>(values[i]);
  return sensors;
}

// Plays the motion through the screen. `sense` makes the sample of the truth, `unexplained` is an acceleration of
// each pair that the model does not know.
class Player {
 public:
  using Sense = std::function<void(double t_s, Array& values)>;

  Player() : clean_(ToSensorsOf(TruthAt(0))) { screen_.Begin(clean_); }

  // One sample; returns it as the screen was given it.
  Sensors Next(const Sense& sense, double period_s = kPeriod_s) {
    const Array before = TruthAt(t_s_);
    t_s_ += period_s;
    const Array now = TruthAt(t_s_);
    Array predicted;
    for (std::size_t i = 0; i < 16; ++i) {
      const double clean = clean_.*kSensorFields[i].in_float;
      predicted[i] = clean + now[i] - before[i];
      // A rate that is off moves its position; angles are small enough for it.
      if (i < 8) predicted[i] += period_s * (clean_.*kSensorFields[8 + i].in_float - before[8 + i]);
    }
    Array values = now;
    sense(t_s_, values);
    const Sensors sensed = ToSensorsOf(values);
    clean_ = screen_.Screen(sensed, ToSensorsOf(predicted), static_cast<float>(period_s));
    return sensed;
  }

  double ErrorOf(std::size_t signal) const {
    return std::abs(clean_.*kSensorFields[signal].in_float - TruthAt(t_s_)[signal]);
  }
  const Sensors& clean() const { return clean_; }
  const SignalScreen& screen() const { return screen_; }
  double t_s() const { return t_s_; }

 private:
  SignalScreen screen_;
  Sensors clean_;
  double t_s_ = 0;
};

TEST(SignalScreenTest, GoodSamplesPassWithTheirBitsThroughNoise) {
  Player player;
  std::mt19937 noise(1);
  for (int sample = 0; sample < 5000; ++sample) {
    const Sensors sensed = player.Next([&](double, Array& values) {
      for (std::size_t i = 0; i < 16; ++i) values[i] += kOrdinaryNoise[i] * NearlyNormal(noise);
    });
    ASSERT_EQ(player.clean(), sensed) << sample;
    ASSERT_FALSE(player.screen().substitutes());
  }
}

// A gust, a lost command, a heavier vehicle: what the model did not expect moves position and rate alike.
TEST(SignalScreenTest, APairThatMovesTogetherIsNoLiar) {
  Player player;
  for (int sample = 0; sample < 1000; ++sample) {
    const Sensors sensed = player.Next([&](double t_s, Array& values) {
      for (const std::size_t i : {0U, 1U, 2U, 6U, 7U}) {
        const double acceleration = i < 3 ? 3.0 : 1.0;
        const double since_s = std::max(0.0, std::min(t_s, 4.0) - 2.0);
        const double coasting_s = std::max(0.0, t_s - 4.0);
        values[8 + i] += acceleration * since_s;
        values[i] += acceleration * since_s * (since_s / 2 + coasting_s);
      }
    });
    ASSERT_EQ(player.clean(), sensed) << sample;
  }
}

TEST(SignalScreenTest, ASampleOfAnotherInstantIsNoLiar) {
  for (const int steps : {-8, -3, 2, 5, 9}) {
    Player player;
    for (int sample = 0; sample < 300; ++sample) {
      const Sensors sensed = player.Next([&](double t_s, Array& values) {
        if (sample % 40 < 20) {
          const Array other = TruthAt(t_s + 0.004 * steps);
          std::copy(other.begin(), other.begin() + 3, values.begin());
        }
      });
      ASSERT_EQ(player.clean(), sensed) << steps << " " << sample;
    }
  }
}

struct Lie {
  const char* name;
  // The value that the signal reads, from its truth, its truth when the lie began, and the time since.
  std::function<double(double truth, double truth_at_begin, double since_s, double size)> reads;
};

const std::vector<Lie>& Lies() {
  static const std::vector<Lie> lies = {
      {"bias", [](double truth, double, double, double size) { return truth + size; }},
      {"drift",
       [](double truth, double, double since_s, double size) { return truth + 0.3 * size * since_s; }},
      {"stuck", [](double, double, double, double size) { return 2 * size; }},
      {"freeze", [](double, double begin, double, double) { return begin; }},
      {"not_a_number",
       [](double, double, double, double) { return std::numeric_limits<double>::quiet_NaN(); }},
      {"spikes", [](double truth, double, double since_s,
                    double size) { return std::fmod(since_s, 0.1) < 0.012 ? truth + 20 * size : truth; }},
      {"hum", [](double truth, double, double since_s,
                 double size) { return truth + 2 * size * std::sin(130 * since_s); }},
  };
  return lies;
}

// The jump that each signal makes, and what may be left of it.
constexpr std::array<double, 16> kSize = {0.6, 0.6, 0.6, 0.3, 0.3, 0.3, 0.6, 0.6, 2, 2, 2, 2, 2, 2, 10, 10};
constexpr std::array<double, 16> kLeft = {0.12, 0.12, 0.12, 0.15, 0.15, 0.15, 0.2, 0.2,
                                          0.5,  0.5,  0.5,  0.5,  0.5,  0.5,  2,   2};

TEST(SignalScreenTest, ALiarIsReplacedByWhatIsNearTheTruthAndBelievedAgainAfterwards) {
  constexpr double kBegin_s = 3;
  constexpr double kEnd_s = 7;
  for (const Lie& lie : Lies()) {
    for (std::size_t signal = 0; signal < 16; ++signal) {
      Player player;
      std::mt19937 noise(1);
      double worst = 0;
      bool replaced = false;
      while (player.t_s() < 20) {
        player.Next([&](double t_s, Array& values) {
          for (std::size_t i = 0; i < 16; ++i) values[i] += kOrdinaryNoise[i] * NearlyNormal(noise);
          if (t_s < kBegin_s || t_s >= kEnd_s) return;
          values[signal] =
              lie.reads(values[signal], TruthAt(kBegin_s)[signal], t_s - kBegin_s, kSize[signal]);
        });
        ASSERT_TRUE(link::IsPlausible(player.clean()));
        replaced = replaced || player.screen().substitutes();
        // A rate's lie shows in its position only after a while.
        if (player.t_s() > kBegin_s + 0.5) worst = std::max(worst, player.ErrorOf(signal));
      }
      EXPECT_LT(worst, kLeft[signal]) << lie.name << " of " << kSensorFields[signal].column;
      EXPECT_TRUE(replaced) << lie.name << " of " << kSensorFields[signal].column;
      EXPECT_FALSE(player.screen().substitutes()) << lie.name << " of " << kSensorFields[signal].column;
    }
  }
}

// A gyroscope that reads a part of the truth is right each time that the vehicle's swing turns. To believe it then made
// its angle look like the liar.
TEST(SignalScreenTest, ARateThatIsRightTwiceInEachSwingIsNeverTakenForItsAnglesLie) {
  constexpr std::size_t kRoll = 3, kRollRate = 11;
  for (const double share : {0.0, 0.06, 0.5}) {
    Player player;
    std::mt19937 noise(1);
    while (player.t_s() < 30) {
      const Sensors sensed = player.Next([&](double t_s, Array& values) {
        for (std::size_t i = 0; i < 16; ++i) values[i] += kOrdinaryNoise[i] * NearlyNormal(noise);
        if (t_s >= 3 && t_s < 25) values[kRollRate] *= share;
      });
      ASSERT_EQ(player.clean().roll_rad, sensed.roll_rad) << share << " at " << player.t_s() << " s";
      // A wrong rate of 0.16 rad/s is near enough to be believed, so half the truth is, at times.
      if (share < 0.5 && player.t_s() > 6 && player.t_s() < 25) {
        ASSERT_LT(player.ErrorOf(kRollRate), 0.12) << share << " at " << player.t_s() << " s";
      }
    }
    EXPECT_LT(player.ErrorOf(kRoll), 0.01);
    EXPECT_FALSE(player.screen().substitutes());
  }
}

// A gyroscope whose zero wanders is near the truth each time that its zero comes back. How near is known only to what it
// takes to be believed, and the rest must not make its angle the liar: replaced by the integral of such a rate, the
// vehicle is lost.
TEST(SignalScreenTest, ARateWhoseZeroWandersIsNeverTakenForItsAnglesLie) {
  constexpr double kBegin_s = 3;
  constexpr double kDensity = 0.11;  // rad/s per root s
  constexpr std::size_t kRollRate = 11;
  int believed_again = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Player player;
    std::mt19937 noise(seed);
    double zero = 0;
    bool replaced = false;
    while (player.t_s() < 40) {
      if (player.t_s() >= kBegin_s) zero += kDensity * std::sqrt(kPeriod_s) * NearlyNormal(noise);
      const Sensors sensed = player.Next([&](double /*t_s*/, Array& values) { values[kRollRate] += zero; });
      ASSERT_EQ(player.clean().roll_rad, sensed.roll_rad)
          << "seed " << seed << " at " << player.t_s() << " s";
      if (replaced && !player.screen().substitutes()) ++believed_again;
      replaced = player.screen().substitutes();
    }
  }
  EXPECT_GT(believed_again, 4);
}

// A servo with noise on its torque gives the hinge another rate in each of the plant's steps, and the sample shows only
// that of the last. Both signals are right.
TEST(SignalScreenTest, AHingeThatANoisyServoMovesIsNoLiar) {
  constexpr std::size_t kHinge = 6, kHingeRate = 14;
  constexpr int kStepsPerSample = 3;
  constexpr double kStep_s = kPeriod_s / kStepsPerSample;
  constexpr double kKick_rad_s = 4;  // 0.11 N m on 1.05e-4 kg m2 for a step
  constexpr double kBegin_s = 3;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Player player;
    std::mt19937 noise(seed);
    double angle = 0, rate = 0;
    while (player.t_s() < 8) {
      for (int step = 0; step < kStepsPerSample && player.t_s() >= kBegin_s; ++step) {
        // As the controller brings the hinge back, within some 50 ms.
        rate += kKick_rad_s * NearlyNormal(noise) - kStep_s * (40 * rate + 400 * angle);
        angle += kStep_s * rate;
      }
      const Sensors sensed = player.Next([&](double /*t_s*/, Array& values) {
        values[kHinge] += angle;
        values[kHingeRate] += rate;
      });
      ASSERT_EQ(player.clean(), sensed) << "seed " << seed << " at " << player.t_s() << " s";
    }
  }
}

// A position that was pulled away together with its rate, which is a wind to every observer, comes back in a jump. It
// is the truth, and followed: along x and y at 1 m/s.
TEST(SignalScreenTest, APositionThatComesBackTogetherWithItsRateIsBelieved) {
  constexpr double kBegin_s = 3, kEnd_s = 8;
  for (const std::size_t signal : {0U, 1U, 2U}) {
    for (const double pull_m_s : {0.19, -0.19, 0.1}) {
      Player player;
      std::mt19937 noise(1);
      double before = 0;
      while (player.t_s() < 12) {
        const Sensors sensed = player.Next([&](double t_s, Array& values) {
          for (std::size_t i = 0; i < 16; ++i) values[i] += kOrdinaryNoise[i] * NearlyNormal(noise);
          if (t_s < kBegin_s || t_s >= kEnd_s) return;
          values[signal] += pull_m_s * (t_s - kBegin_s);
          values[8 + signal] += pull_m_s;
        });
        const auto field = kSensorFields[signal].in_float;
        const double lie = std::abs(pull_m_s) * (kEnd_s - kBegin_s);
        const double since_s = player.t_s() - kEnd_s;
        if (since_s < 0) {
          ASSERT_EQ(player.clean().*field, sensed.*field) << player.t_s();
        } else {
          // In the sample of the jump, too.
          const double left = signal == 2 ? 0 : lie - since_s;
          ASSERT_LT(player.ErrorOf(signal), std::max(left, 0.0) + 0.05) << signal << " at " << player.t_s();
          if (signal != 2) {
            ASSERT_LT(std::abs(player.ErrorOf(signal) - before), 0.012 + 0.02) << player.t_s();
          }
        }
        before = since_s < 0 ? lie : player.ErrorOf(signal);
      }
      EXPECT_FALSE(player.screen().substitutes());
    }
  }
}

// In gusts the model cannot say who lies, and a height that drifts is followed. Its jump back is the truth.
TEST(SignalScreenTest, AJumpBackFromADriftThatWasNotSeenIsFollowed) {
  Player player;
  bool drift_was_flown = true;
  while (player.t_s() < 12) {
    const Sensors sensed = player.Next([](double t_s, Array& values) {
      constexpr double kGustRad_s = 2, kGust_m = 0.5;
      values[2] += kGust_m * (1 - std::cos(kGustRad_s * t_s));
      values[10] += kGust_m * kGustRad_s * std::sin(kGustRad_s * t_s);
      if (t_s >= 3 && t_s < 8) values[2] += 0.1 * (t_s - 3);
    });
    const float beside_m = std::abs(player.clean().z_m - sensed.z_m);
    if (player.t_s() < 8) {
      drift_was_flown = drift_was_flown && beside_m == 0;
    } else {
      ASSERT_LT(beside_m, 0.01) << player.t_s();
    }
  }
  EXPECT_TRUE(drift_was_flown);
  EXPECT_FALSE(player.screen().substitutes());
}

// An offset is accepted in the end, as the rate's zero may be wrong; its end is no lie that begins.
TEST(SignalScreenTest, AJumpBackFromAnOffsetThatWasAcceptedIsFollowed) {
  Player player;
  std::mt19937 noise(1);
  while (player.t_s() < 25) {
    player.Next([&](double t_s, Array& values) {
      for (std::size_t i = 0; i < 16; ++i) values[i] += kOrdinaryNoise[i] * NearlyNormal(noise);
      if (t_s >= 3 && t_s < 20) values[2] += 0.3;
    });
    if (player.t_s() > 16 && player.t_s() < 20) {
      ASSERT_NEAR(player.ErrorOf(2), 0.3, 0.02) << player.t_s();
    }
    if (player.t_s() > 20) {
      ASSERT_LT(player.ErrorOf(2), 0.05) << player.t_s();
    }
  }
  EXPECT_FALSE(player.screen().substitutes());
}

// The duration of an earlier lie proves nothing about the zero of the rate now.
TEST(SignalScreenTest, AnOffsetThatBeginsWithAMissingNumberIsNotBelievedForAnEarlierLie) {
  Player player;
  while (player.t_s() < 42) {
    player.Next([](double t_s, Array& values) {
      if (t_s >= 3 && t_s < 33) values[2] += 2;
      if (t_s >= 40) values[2] = t_s < 40.012 ? std::numeric_limits<double>::quiet_NaN() : values[2] + 0.6;
    });
    ASSERT_LT(player.ErrorOf(2), 0.05) << player.t_s();
  }
}

// A sample after a gap is believed, as nothing tells it from a vehicle that moved. If it lied, the next one is no liar.
TEST(SignalScreenTest, AJumpBackFromALieAfterAGapIsFollowed) {
  Player player;
  while (player.t_s() < 3) player.Next([](double, Array&) {});
  player.Next([](double, Array& values) { values[2] += 2; }, 0.06);
  while (player.t_s() < 6) {
    player.Next([](double, Array&) {});
    ASSERT_LT(player.ErrorOf(2), 0.05) << player.t_s();
  }
  EXPECT_FALSE(player.screen().substitutes());
}

}  // namespace
}  // namespace tiltproof::firmware
