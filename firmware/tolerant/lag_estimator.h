// Estimates the lag of commands, in steps. The estimator compares each accepted sample with the one before it, moved on
// under every lag. It takes a lag that explains the last samples clearly better than the present one.
//
//   estimator.Update(timeline, step, sample);     // before timeline.Correct(step, sample)
//   if (!estimator.model_is_right()) ...          // no lag explains the samples: this is another vehicle
//
// The hypotheses cost 13 lags times the steps between the samples. The estimator computes them only while the present
// lag does not fit.
#pragma once

#include <array>

#include "firmware/tolerant/motion_timeline.h"

namespace tiltproof::firmware {

class LagEstimator {
 public:
  // A misfit above is examined: 16 signals, each half a spread away.
  static constexpr float kFitMisfit = 4;
  // A surprise is so many times the usual misfit.
  static constexpr float kSurprise = 2.5F;
  // The misfit of the right model with the expected noise: 16 signals, each a spread away. More noise makes evidence
  // weaker.
  static constexpr float kNoiseMisfit = 16;
  // The average over about 20 samples of the best lag's misfit at which the model is given up.
  static constexpr float kModelFading = 0.95F;
  static constexpr float kModelMisfitMax = 60;

  void Update(MotionTimeline& timeline, ModelStep step, const MotionState& sample);
  void Reset() { *this = {}; }

  bool model_is_right() const;
  // True if the last sample was further from its prediction than model and noise make it, and some lag explains that.
  bool surprised() const { return surprised_; }

 private:
  // For each lag against the present one, older samples fading: differences of misfits, which are twice the
  // logarithms of likelihood ratios (Wald's sequential test).
  std::array<float, MotionTimeline::kLagMax + 1> evidence_{};
  float model_misfit_ = 0;  // of the best lag, averaged
  bool surprised_ = false;
};

}  // namespace tiltproof::firmware
