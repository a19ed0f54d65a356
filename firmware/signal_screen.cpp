#include "firmware/signal_screen.h"

#include <algorithm>
#include <cmath>

#include "firmware/trigonometry.h"
#include "firmware/vehicle_dynamics.h"

namespace tiltproof::firmware {
namespace {

constexpr float kStep_s = static_cast<float>(ToSeconds(kModelStepNs));

// Two sights: 0.1 s tells jumps in any wind, 1.5 s finds drifts in air that is calm for so long.
constexpr std::array<float, 2> kWindow_s = {0.1F, 1.5F};
// A drift's contradiction grows with the window, and so do the errors of a sensor's frame and of the clock.
constexpr std::array<float, 2> kWindowTolerance = {1, 2};

// How far a pair may contradict itself: ten times ordinary noise (2 mm, 1 mrad, hinges 1 mrad, with rates of 1 cm/s,
// 10 and 30 mrad/s, as firmware/innovation.h), and a sample that is stamped two steps beside. The inputs of the
// hinges' motion change within a sample.
constexpr std::array<float, 8> kContradictionMax = {3e-2F, 3e-2F, 3e-2F, 3e-2F, 3e-2F, 3e-2F, 0.1F, 0.1F};
constexpr float kStamp_s = 2 * kStep_s;
// How near to its substitute a rate must be to be believed again: the filter's noise, five times.
constexpr std::array<float, 8> kRateAgreement = {0.15F, 0.15F, 0.15F, 0.3F, 0.3F, 0.3F, 1, 1};
// The model explains one of the two so many times better than the other.
constexpr float kClearer = 2;
// Less than this share of the tolerance is no evidence.
constexpr float kEvidenceShare = 0.5F;
// The same bits so often are a frozen signal, if the pair contradicts itself by this share of the tolerance.
constexpr std::int32_t kFrozenRepeats = 3;
constexpr float kFrozenShare = 0.25F;
// Samples in a row in which a liar must be right to be believed again: 0.1 s.
constexpr std::int32_t kAgreeingSamples = 8;
// The integral of a rate goes wrong with the rate's zero: 1 cm/s, 10 mrad/s. So an offset is accepted in the end.
constexpr float kZeroError = 1e-2F;
// Of the filter that replaces a rate, per sample.
constexpr float kRateGain = 0.2F;
// Samples further apart say nothing about each other.
constexpr float kElapsedMax_s = 10 * kStep_s;
// A shift in time is at most 12 steps, the largest lag, and shows in a vehicle that moves.
constexpr float kShiftMax_s = 12 * kStep_s;
constexpr float kShiftSpeedMin_m_s = 0.2F;

constexpr std::size_t kRoll = 3, kPitch = 4, kYaw = 5, kRollRate = 11, kPitchRate = 12, kYawRate = 13;
constexpr bool IsAngle(std::size_t pair) { return pair >= kRoll && pair <= kYaw; }

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

  SineCosine pitch, yaw;
};

// What a position moves while its rate goes from one to the other, in semi-implicit steps.
float Moved(float rate_before, float rate, float elapsed_s) {
  return 0.5F * elapsed_s * (rate_before + rate) + 0.5F * kStep_s * (rate - rate_before);
}

float Difference(std::size_t pair, float a, float b) {
  const float difference = a - b;
  return pair == kRoll || pair == kYaw ? WrapAngle(std::clamp(difference, -100.0F, 100.0F)) : difference;
}

}  // namespace

bool IsFinite(const Sensors& sensors) {
  const auto values = ToArray(sensors);
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

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
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    Pair& pair = pairs_[i % kPairCount];
    std::int32_t& repeats = i < kPairCount ? pair.position_repeats : pair.rate_repeats;
    repeats = values[i] == sensed_[i] ? repeats + 1 : 0;
    sensed_[i] = values[i];
    if (std::isfinite(values[i])) continue;
    values[i] = model[i];
    pair.liar = i < kPairCount ? Liar::kPosition : Liar::kRate;
    pair.agreeing_count = 0;
  }
  values = rates.ToAngleRates(values);
  model = rates.ToAngleRates(model);

  std::array<bool, kWindowCount> shifted{};
  if (elapsed_s <= kElapsedMax_s) {
    Accumulate(values, model, elapsed_s);
    for (std::size_t window = 0; window < kWindowCount; ++window)
      shifted[window] = IsShiftInTime(window, values);
  }
  Values clean = values;
  for (std::size_t pair = 0; pair < kPairCount; ++pair) {
    const float tolerance = kContradictionMax[pair] + kStamp_s * std::abs(model[kPairCount + pair]);
    const Window* accusing = nullptr;
    if (elapsed_s <= kElapsedMax_s) accusing = Accuse(pair, tolerance, shifted);
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

void SignalScreen::Accumulate(const Values& values, const Values& model, float elapsed_s) {
  for (std::size_t i = 0; i < kPairCount; ++i) {
    const std::size_t rate = kPairCount + i;
    const float contradiction =
        Difference(i, values[i], raw_[i]) - Moved(raw_[rate], values[rate], elapsed_s);
    const float rate_surprise = values[rate] - raw_[rate] - (model[rate] - clean_[rate]);
    for (std::size_t w = 0; w < kWindowCount; ++w) {
      Window& window = pairs_[i].windows[w];
      const float fading = kWindow_s[w] / (kWindow_s[w] + elapsed_s);
      const float before = fading * window.rate_surprise;
      const float contradicted = window.contradiction;
      window.contradiction = fading * contradicted + contradiction;
      window.contradiction_twice =
          fading * (window.contradiction_twice + window.contradiction - contradicted);
      window.rate_surprise = before + rate_surprise;
      window.surprise = fading * window.surprise + Moved(before, window.rate_surprise, elapsed_s);
    }
  }
}

bool SignalScreen::IsShiftInTime(std::size_t window, const Values& values) const {
  float speed_2 = 0;
  float along = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    speed_2 += values[kPairCount + i] * values[kPairCount + i];
    along += values[kPairCount + i] * pairs_[i].windows[window].contradiction;
  }
  if (speed_2 < kShiftSpeedMin_m_s * kShiftSpeedMin_m_s) return false;
  const float shift_s = along / speed_2;
  bool shifted = std::abs(shift_s) <= kShiftMax_s;
  for (std::size_t i = 0; i < 3; ++i) {
    const float rest = pairs_[i].windows[window].contradiction - shift_s * values[kPairCount + i];
    shifted = shifted && std::abs(rest) < kContradictionMax[i];
  }
  return shifted;
}

SignalScreen::Liar SignalScreen::Verdict(const Window& window, float tolerance) {
  if (std::abs(window.contradiction) <= tolerance) return Liar::kNone;
  // What is left to explain if the one lies or the other.
  const float if_position = std::abs(window.surprise);
  const float if_rate = std::abs(window.contradiction_twice + window.surprise);
  if (std::max(if_position, if_rate) < kEvidenceShare * tolerance) return Liar::kNone;
  if (kClearer * if_position < if_rate) return Liar::kPosition;
  if (kClearer * if_rate < if_position) return Liar::kRate;
  return Liar::kNone;
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
    if (liar == Liar::kPosition && pair_index < 3 && shifted[w] && !position_frozen) liar = Liar::kNone;
    if (liar == Liar::kNone) continue;
    pair.liar = liar;
    pair.lying_s = 0;
    pair.agreeing_count = 0;
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
  if (pair.liar == Liar::kPosition) {
    // Back to before the lie began, or on from there.
    const float substitute = accusing != nullptr
                                 ? position - accusing->contradiction
                                 : model[pair_index] + Moved(0, rate - model[rate_index], elapsed_s);
    agrees =
        std::abs(Difference(pair_index, position, substitute)) < 0.5F * tolerance + kZeroError * pair.lying_s;
    position = substitute;
  } else {
    const float before = accusing != nullptr ? rate - accusing->rate_surprise : model[rate_index];
    const float error =
        std::clamp(Difference(pair_index, position, model[pair_index]), -tolerance, tolerance);
    const float substitute = before + kRateGain / elapsed_s * error;
    agrees = std::abs(rate - substitute) <
             kRateAgreement[pair_index] + std::abs(model[rate_index] - clean_[rate_index]);
    rate = substitute;
  }
  pair.lying_s += elapsed_s;
  pair.agreeing_count = agrees ? pair.agreeing_count + 1 : 0;
  if (pair.agreeing_count >= kAgreeingSamples) {
    pair.windows = {};
    pair.liar = Liar::kNone;
  }
}

}  // namespace tiltproof::firmware
