#include "firmware/tolerant/lag_estimator.h"

#include <algorithm>

#include "firmware/tolerant/innovation.h"

namespace tiltproof::firmware {
namespace {

constexpr float kFading = 0.8F;  // per sample
// A surprise is the line's when commands that came late, or not at all, leave so little of it. A push, or an actuator, does
// not look like that.
constexpr float kExplained = 0.5F;
// Largest evidence of one sample for or against a lag, and evidence to believe it. Belief takes six samples in a row,
// because a command that was lost looks like a lag of a period.
constexpr float kSampleEvidence = 8;
constexpr float kEvidence = 28;
// Between samples further apart the model itself is too uncertain.
constexpr ModelStep kLagStepsMax = 8;

}  // namespace

void LagEstimator::Update(MotionTimeline& timeline, ModelStep step, const MotionState& sample) {
  const ModelStep count = step - timeline.last_sample_step();
  const MotionState before = timeline.last_sample();
  const ModelStep lag = timeline.lag();
  if (count > kLagStepsMax) return;

  const float misfit = Misfit(sample, timeline.At(step), before);
  const bool fits = misfit < kFitMisfit;
  const float surprise = kSurprise * std::max(model_misfit_, kFitMisfit);
  const float scale = 1 / std::max(1.0F, model_misfit_ / kNoiseMisfit);
  float best_misfit = misfit;
  for (ModelStep i = 0; i <= MotionTimeline::kLagMax; ++i) {
    float& evidence = evidence_[static_cast<std::size_t>(i)];
    evidence *= kFading;
    if (fits || i == lag) continue;
    const float other = Misfit(sample, timeline.Suppose(count, i), before);
    evidence += std::clamp(scale * (misfit - other), -kSampleEvidence, kSampleEvidence);
    best_misfit = std::min(best_misfit, other);
  }
  surprised_ = misfit > surprise && best_misfit < kExplained * misfit;
  model_misfit_ += (1 - kModelFading) * (best_misfit - model_misfit_);

  const auto* best = std::max_element(evidence_.begin(), evidence_.end());
  if (*best < kEvidence) return;
  timeline.SetLag(static_cast<ModelStep>(best - evidence_.begin()));
  evidence_.fill(0);
}

bool LagEstimator::model_is_right() const { return model_misfit_ < kModelMisfitMax; }

}  // namespace tiltproof::firmware
