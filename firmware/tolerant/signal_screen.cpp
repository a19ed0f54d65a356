#include "firmware/tolerant/signal_screen.h"

#include <algorithm>
#include <cmath>

#include "firmware/tolerant/vehicle_dynamics.h"
#include "firmware/trigonometry.h"

namespace tiltproof::firmware {
namespace {

constexpr float kGridStep_s = static_cast<float>(ToSeconds(kModelStepNs));

// Two sights: 0.1 s tells jumps in any wind, 1.5 s finds drifts in air that is calm for so long.
constexpr std::array<float, 2> kWindow_s = {0.1F, 1.5F};
// A drift's contradiction grows with the window, and so do the errors of a sensor's frame and of the clock.
constexpr std::array<float, 2> kWindowTolerance = {1, 1.3F};

// Tolerance of a pair's contradiction. It covers ten times ordinary noise (2 mm, 1 mrad, hinges 1 mrad, with rates of
// 1 cm/s, 10 and 30 mrad/s, as firmware/tolerant/innovation.h), and a sample that is stamped two steps beside. The inputs of the
// hinges' motion change within a sample.
constexpr std::array<float, 8> kContradictionMax = {3e-2F, 3e-2F, 3e-2F, 3e-2F, 3e-2F, 3e-2F, 6e-2F, 6e-2F};
constexpr float kStamp_s = 2 * kGridStep_s;
// Distance from its substitute at which a rate is believed again: five times the filter's noise. On average it must be
// a quarter of that, which is less than the lie that can be seen.
constexpr std::array<float, 8> kRateAgreement = {0.15F, 0.15F, 0.15F, 0.16F, 0.16F, 0.16F, 0.5F, 0.5F};
constexpr float kAverageShare = 0.25F;
constexpr float kAverage_s = 0.25F;
// The model explains one of the two so many times better than the other.
constexpr float kClearer = 2;
// Less than this share of the tolerance is no evidence.
constexpr float kEvidenceShare = 0.5F;
// Nor is less than twice what a model does that is wrong by a tenth of each change of the rate.
constexpr float kModelError = 0.1F;
constexpr float kDoubts = 2;
// A steady acceleration that the model does not know, as of a heavier vehicle or in a wind, is learned in 5 s.
constexpr float kSteady_s = 5;
// Surprises of the last 10 s in which the pair agreed are this model's on this vehicle, in this air.
constexpr float kUsual_s = 10;
constexpr float kUsuals = 2;
// A position that jumps may come back from a lie that was not seen. It does if the jump takes away most of what x, y
// or z has strayed from its rate in the last 20 s, or if the rate steps in the same sample: five times the ordinary
// noise of a difference.
constexpr std::size_t kPlaces = 3;
constexpr float kStrayed_s = 20;
constexpr float kStrayedShare = 0.5F;
constexpr float kRateStep_m_s = 7e-2F;
// Speed at which the screen follows it then: a step across would tilt the vehicle.
constexpr std::array<float, kPlaces> kReturn_m_s = {1, 1, 1e9F};
// A pair agrees that contradicts itself by less than this share of the tolerance.
constexpr float kCalmShare = 0.25F;
// The integral of a rate between two samples is known as far as the rate changes evenly between them. A hinge has so
// little inertia that its torque's noise makes another rate of each step: what the model does not foresee of the change
// may have come in the first step or in the last. The angle shows it then, too, which no lie of the one signal does.
// Beyond so many sigmas of that, a contradiction is one.
constexpr float kIntegralSigmas = 5;
// Rate changes in a sample beyond any input within the actuators' limits, m/s and rad/s. Inputs: 60 N on 2.09 kg,
// 30 N at 0.278 m on 0.084 kg m2, two servos' 2 N m on 0.0101 kg m2, both thrusts tilted at 0.278 m on 0.079 kg m2, and
// ordinary noise. Hinges: no limit.
constexpr float kRateJumpSample_s = 0.012F;
constexpr std::array<float, 8> kRateJumpMax = {0.5F, 0.5F, 0.5F, 1.4F, 5, 2.7F, 1e9F, 1e9F};
// The same bits so often are a frozen signal, if the pair contradicts itself by this share of the tolerance.
constexpr std::int32_t kFrozenRepeats = 3;
constexpr float kFrozenShare = 0.25F;
// Samples in a row in which a liar must be right to be believed again. A position: 0.1 s. A rate that is scaled, late or
// dead is right twice in each swing of the vehicle, so a rate: 1.5 s, the long window.
constexpr std::array<std::int32_t, 2> kAgreeingSamples = {8, 125};
// The integral of a rate goes wrong with the rate's zero: what can be seen of it is 3 cm/s,
// 30 mrad/s. So an offset is accepted in the end.
constexpr float kZeroError = 3e-2F;
// Gain of the filter that replaces a rate, per sample.
constexpr float kRateGain = 0.2F;
// And what it takes from one position at most, in case that one is noisy. Hinges are fast.
constexpr std::array<float, 8> kRateErrorShare = {0.25F, 0.25F, 0.25F, 0.25F, 0.25F, 0.25F, 1, 1};
// Samples further apart say nothing about each other.
constexpr float kElapsedMax_s = 10 * kGridStep_s;
// A shift in time is at most 12 steps, the largest lag, and shows in a vehicle that moves.
constexpr float kShiftMax_s = 12 * kGridStep_s;
constexpr float kShiftSpeedMin_m_s = 0.2F;

constexpr std::size_t kRoll = 3, kPitch = 4, kYaw = 5, kRollRate = 11, kPitchRate = 12, kYawRate = 13;
constexpr bool IsAngle(std::size_t pair) { return pair >= kRoll && pair <= kYaw; }
constexpr bool IsHinge(std::size_t pair) { return pair > kYaw; }

std::array<float, kSensorCount> ToArray(const Sensors& sensors) {
  std::array<float, kSensorCount> values;
  for (std::size_t i = 0; i < kSensorCount; ++i) values[i] = sensors.*kSensorFields[i].in_float;
  return values;
}

// Between angular rates along the world's axes and the rates of roll, pitch and yaw, at one attitude.
struct AttitudeRates {
  explicit AttitudeRates(const Sensors& at)
      : pitch(ComputeSineCosine(at.pitch_rad)), yaw(ComputeSineCosine(at.yaw_rad)) {
    // Straight up there are no such rates; what is flown is far from it.
    pitch.cosine = std::max(pitch.cosine, 0.1F);
  }

  std::array<float, kSensorCount> ToAngleRates(std::array<float, kSensorCount> values) const {
    const float roll_rate = (yaw.cosine * values[kRollRate] + yaw.sine * values[kPitchRate]) / pitch.cosine;
    values[kPitchRate] = yaw.cosine * values[kPitchRate] - yaw.sine * values[kRollRate];
    values[kYawRate] += pitch.sine * roll_rate;
    values[kRollRate] = roll_rate;
    return values;
  }
  std::array<float, kSensorCount> ToWorldRates(std::array<float, kSensorCount> values) const {
    const float along = pitch.cosine * values[kRollRate];
    const float across = values[kPitchRate];
    values[kYawRate] -= pitch.sine * values[kRollRate];
    values[kRollRate] = yaw.cosine * along - yaw.sine * across;
    values[kPitchRate] = yaw.sine * along + yaw.cosine * across;
    return values;
  }

  // The angular rate that the rate of this angle is nearest to.
  std::size_t AxisOf(std::size_t angle) const {
    if (angle == kYaw || std::abs(yaw.cosine) > std::abs(yaw.sine)) return kRollRate + angle - kRoll;
    return angle == kRoll ? kPitchRate : kRollRate;
  }

  SineCosine pitch, yaw;
};

// Displacement of a position while its rate goes from one to the other, in semi-implicit steps.
float Moved(float rate_before, float rate, float elapsed_s) {
  return 0.5F * elapsed_s * (rate_before + rate) + 0.5F * kGridStep_s * (rate - rate_before);
}

float Difference(std::size_t pair, float a, float b) {
  const float difference = a - b;
  return pair == kRoll || pair == kYaw ? WrapAngle(std::clamp(difference, -100.0F, 100.0F)) : difference;
}

}  // namespace

void SignalScreen::Begin(const Sensors& sample) {
  *this = {};
  sensed_ = ToArray(sample);
  raw_ = clean_ = AttitudeRates(sample).ToAngleRates(sensed_);
}

Sensors SignalScreen::Patch(const Sensors& sensed, const Sensors& predicted) const {
  Sensors patched = sensed;
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    const auto field = kSensorFields[i].in_float;
    const Liar liar = i < kPairCount ? Liar::kPosition : Liar::kRate;
    if (pairs_[i % kPairCount].liar == liar || !std::isfinite(sensed.*field))
      patched.*field = predicted.*field;
  }
  return patched;
}

Sensors SignalScreen::Screen(const Sensors& sensed, const Sensors& predicted, float elapsed_s) {
  const AttitudeRates rates(predicted);
  Values values = ToArray(sensed);
  Values model = ToArray(predicted);
  startled_ = false;
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    Pair& pair = pairs_[i % kPairCount];
    std::int32_t& repeats = i < kPairCount ? pair.position_repeats : pair.rate_repeats;
    repeats = values[i] == sensed_[i] ? repeats + 1 : 0;
    sensed_[i] = values[i];
    if (std::isfinite(values[i])) continue;
    values[i] = model[i];
    startled_ = startled_ || pair.liar == Liar::kNone;
    Call(pair, i < kPairCount ? Liar::kPosition : Liar::kRate);
  }
  // An angular rate that lies is in the rates of two angles. The pair that it is held against judges it; the others
  // see it as predicted.
  Values without_liars = values;
  for (std::size_t i = kRoll; i <= kYaw; ++i) {
    if (pairs_[i].liar == Liar::kRate) without_liars[rates.AxisOf(i)] = model[rates.AxisOf(i)];
  }
  values = rates.ToAngleRates(values);
  without_liars = rates.ToAngleRates(without_liars);
  for (std::size_t i = kRoll; i <= kYaw; ++i) {
    if (pairs_[i].liar != Liar::kRate) values[kPairCount + i] = without_liars[kPairCount + i];
  }
  model = rates.ToAngleRates(model);

  std::array<bool, kWindowCount> shifted{};
  if (elapsed_s <= kElapsedMax_s) {
    Accumulate(values, model, elapsed_s);
    for (std::size_t window = 0; window < kWindowCount; ++window)
      shifted[window] = IsShiftInTime(window, values);
  } else {
    // Not judged, but remembered: the next sample may take it back.
    for (std::size_t i = 0; i < kPlaces; ++i) pairs_[i].strayed += values[i] - model[i];
  }
  Values clean = values;
  for (std::size_t pair = 0; pair < kPairCount; ++pair) {
    const float tolerance = kContradictionMax[pair] + kStamp_s * std::abs(model[kPairCount + pair]);
    const Window* accusing = nullptr;
    const float jump = std::abs(pairs_[pair].windows[0].contradiction - pairs_[pair].contradiction_before);
    if (elapsed_s <= kElapsedMax_s) accusing = Accuse(pair, tolerance, shifted);
    startled_ = startled_ || (accusing != nullptr && jump > tolerance && !pairs_[pair].returns);
    Replace(pair, model, elapsed_s, tolerance, accusing, clean);
  }
  raw_ = values;
  clean_ = clean;

  clean = rates.ToWorldRates(clean);
  substitutes_ = false;
  bool turns = false;  // an angular rate is replaced: each of the three depends on all
  for (std::size_t i = 0; i < kPairCount; ++i) {
    substitutes_ = substitutes_ || pairs_[i].liar != Liar::kNone;
    turns = turns || (IsAngle(i) && pairs_[i].liar == Liar::kRate);
  }
  Sensors result = sensed;
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    const Liar liar = pairs_[i % kPairCount].liar;
    const bool replaced = i < kPairCount            ? liar == Liar::kPosition
                          : IsAngle(i - kPairCount) ? turns
                                                    : liar == Liar::kRate;
    if (replaced) result.*kSensorFields[i].in_float = clean[i];
  }
  return result;
}

void SignalScreen::Call(Pair& pair, Liar liar) {
  if (pair.liar != liar) pair.lying_s = 0;
  pair.liar = liar;
  pair.returns = false;
  pair.agreeing_count = 0;
}

void SignalScreen::Accumulate(const Values& values, const Values& model, float elapsed_s) {
  for (std::size_t i = 0; i < kPairCount; ++i) {
    const std::size_t rate = kPairCount + i;
    const float moved = Difference(i, values[i], raw_[i]);
    const float contradiction = moved - Moved(raw_[rate], values[rate], elapsed_s);
    Pair& pair = pairs_[i];
    const float model_change = model[rate] - clean_[rate];
    const float unexplained = values[rate] - raw_[rate] - model_change;
    const float rate_surprise = unexplained - elapsed_s * pair.steady_per_s;
    const float integral_error =
        IsHinge(i) ? std::min(std::abs(elapsed_s / 3 * unexplained), std::abs(moved - pair.moved_before)) : 0;
    pair.moved_before = moved;
    const bool calm = pair.liar == Liar::kNone &&
                      std::abs(contradiction) < kCalmShare * kContradictionMax[i] &&
                      std::all_of(pair.windows.begin(), pair.windows.end(), [&](const Window& window) {
                        return std::abs(window.contradiction) < kCalmShare * kContradictionMax[i];
                      });
    if (calm) pair.steady_per_s += elapsed_s / (kSteady_s * kWindow_s[1]) * pair.windows[1].rate_surprise;
    pair.strayed = kStrayed_s / (kStrayed_s + elapsed_s) * pair.strayed + contradiction;
    pair.rate_steps = std::abs(rate_surprise) > kRateStep_m_s + kModelError * std::abs(model_change);
    pair.jumps = std::abs(unexplained) > kRateJumpMax[i] * std::max(1.0F, elapsed_s / kRateJumpSample_s);
    for (std::size_t w = 0; w < kWindowCount; ++w) {
      Window& window = pair.windows[w];
      const float fading = kWindow_s[w] / (kWindow_s[w] + elapsed_s);
      const float before = fading * window.rate_surprise;
      const float contradicted = window.contradiction;
      if (w == 0) pair.contradiction_before = contradicted;
      window.contradiction = fading * contradicted + contradiction;
      window.contradiction_twice =
          fading * (window.contradiction_twice + window.contradiction - contradicted);
      window.rate_surprise = before + rate_surprise;
      window.surprise = fading * window.surprise + Moved(before, window.rate_surprise, elapsed_s);
      if (calm) {
        window.usual_surprise =
            std::max(std::abs(window.surprise), kUsual_s / (kUsual_s + elapsed_s) * window.usual_surprise);
      }
      window.rate_rest *= fading;
      window.surprise_rest = fading * window.surprise_rest + elapsed_s * window.rate_rest;
      window.integral_error_2 = fading * fading * window.integral_error_2 + integral_error * integral_error;
      const float doubt = kWindow_s[w] * kModelError * model_change;
      window.surprise_doubt_2 = fading * fading * window.surprise_doubt_2 + doubt * doubt;
    }
  }
}

bool SignalScreen::IsShiftInTime(std::size_t window, const Values& values) const {
  float speed_2 = 0;
  float along = 0;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    speed_2 += values[kPairCount + i] * values[kPairCount + i];
    along += values[kPairCount + i] * pairs_[i].windows[window].contradiction;
  }
  if (speed_2 < kShiftSpeedMin_m_s * kShiftSpeedMin_m_s) return false;
  const float shift_s = along / speed_2;
  bool shifted = std::abs(shift_s) <= kShiftMax_s;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const float rest = pairs_[i].windows[window].contradiction - shift_s * values[kPairCount + i];
    shifted = shifted && std::abs(rest) < kContradictionMax[i];
  }
  return shifted;
}

SignalScreen::Liar SignalScreen::Verdict(const Window& window, float tolerance) {
  if (window.contradiction * window.contradiction <=
      tolerance * tolerance + kIntegralSigmas * kIntegralSigmas * window.integral_error_2)
    return Liar::kNone;
  // The surprise that is left if the position lies, or if the rate lies.
  const float if_position = std::abs(window.surprise);
  const float if_rate = std::abs(window.contradiction_twice + window.surprise);
  if (std::max(if_position, if_rate) < kEvidenceShare * tolerance) return Liar::kNone;
  const auto is_clear = [&](float right, float wrong) {
    return kClearer * right < wrong && wrong > kUsuals * window.usual_surprise &&
           wrong * wrong > kDoubts * kDoubts * window.surprise_doubt_2;
  };
  // A rate that was believed again may still lie a little: that is no surprise, and looks like a lie of its position.
  if (is_clear(if_position, if_rate) && if_rate > window.surprise_rest) return Liar::kPosition;
  if (is_clear(if_rate, if_position)) return Liar::kRate;
  return Liar::kNone;
}

bool SignalScreen::IsBack(const Pair& pair, float tolerance) {
  const float jump = pair.windows[0].contradiction - pair.contradiction_before;
  if (std::abs(jump) <= tolerance) return false;
  return pair.rate_steps || std::abs(pair.strayed) < kStrayedShare * std::abs(jump);
}

const SignalScreen::Window* SignalScreen::Accuse(std::size_t pair_index, float tolerance,
                                                 const std::array<bool, kWindowCount>& shifted) {
  Pair& pair = pairs_[pair_index];
  if (pair.liar != Liar::kNone) return nullptr;
  for (std::size_t w = 0; w < kWindowCount; ++w) {
    const Window& window = pair.windows[w];
    const bool position_frozen = pair.position_repeats >= kFrozenRepeats;
    Liar liar = Verdict(window, kWindowTolerance[w] * tolerance);
    if (liar == Liar::kNone) {
      const Liar hint = Verdict(window, kFrozenShare * kWindowTolerance[w] * tolerance);
      if (hint == Liar::kPosition && position_frozen) liar = hint;
      if (hint == Liar::kRate && pair.rate_repeats >= kFrozenRepeats) liar = hint;
    }
    if (liar == Liar::kPosition && pair_index < kPlaces && shifted[w] && !position_frozen) liar = Liar::kNone;
    if (pair.jumps) liar = Liar::kRate;
    if (liar == Liar::kNone) continue;
    Call(pair, liar);
    pair.returns = liar == Liar::kPosition && pair_index < kPlaces && IsBack(pair, tolerance);
    return &window;
  }
  return nullptr;
}

void SignalScreen::Replace(std::size_t pair_index, const Values& model, float elapsed_s, float tolerance,
                           const Window* accusing, Values& clean) {
  Pair& pair = pairs_[pair_index];
  if (pair.liar == Liar::kNone) return;
  const std::size_t rate_index = kPairCount + pair_index;
  float& position = clean[pair_index];
  float& rate = clean[rate_index];
  bool agrees = false;
  float position_rest = 0;
  if (pair.liar == Liar::kPosition) {
    // Back to before the lie began, or on from there.
    float substitute = accusing != nullptr
                           ? position - accusing->contradiction
                           : model[pair_index] + Moved(0, rate - model[rate_index], elapsed_s);
    if (pair.returns) {
      const float step = kReturn_m_s[pair_index] * elapsed_s;
      substitute += std::clamp(Difference(pair_index, position, substitute), -step, step);
    }
    position_rest = Difference(pair_index, position, substitute);
    agrees = std::abs(position_rest) < 0.5F * tolerance + kZeroError * pair.lying_s;
    position = model[pair_index] + Difference(pair_index, substitute, model[pair_index]);
  } else {
    const float before = accusing != nullptr ? rate - accusing->rate_surprise : model[rate_index];
    const float error_max = kRateErrorShare[pair_index] * tolerance;
    const float error =
        std::clamp(Difference(pair_index, position, model[pair_index]), -error_max, error_max);
    const float substitute = before + kRateGain / elapsed_s * error;
    const float lie = rate - substitute;
    const float change = std::abs(model[rate_index] - clean_[rate_index]);
    if (accusing != nullptr) pair.average_lie = lie;
    pair.average_lie += elapsed_s / (kAverage_s + elapsed_s) * (lie - pair.average_lie);
    agrees = std::abs(lie) < kRateAgreement[pair_index] + change &&
             std::abs(pair.average_lie) < kAverageShare * kRateAgreement[pair_index];
    rate = substitute;
  }
  pair.lying_s += elapsed_s;
  pair.agreeing_count = agrees ? pair.agreeing_count + 1 : 0;
  if (pair.agreeing_count < kAgreeingSamples[pair.liar == Liar::kRate]) return;
  // The screen believes the rest of the lie from now on, and remembers it. A forgotten rest of a rate's lie would look
  // like a lie of the position. The jump at the end of a position's rest would look like the next lie.
  const float rate_rest = pair.liar == Liar::kRate ? pair.average_lie : 0;
  // So far from its average may the lie be that agreed in the last sample.
  const float rate_rest_max = pair.liar == Liar::kRate ? (1 + kAverageShare) * kRateAgreement[pair_index] : 0;
  for (Window& window : pair.windows) {
    window = {
        .rate_surprise = rate_rest, .usual_surprise = window.usual_surprise, .rate_rest = rate_rest_max};
  }
  pair.strayed = position_rest;
  pair.liar = Liar::kNone;
}

}  // namespace tiltproof::firmware
