#include "firmware/tolerant/reply_matcher.h"

#include <algorithm>

#include "firmware/tolerant/innovation.h"

namespace tiltproof::firmware {
namespace {

// Costs of an unlikely match, in units of the misfit, which are twice a logarithm of likelihood. Unlikely are a round
// trip that differs from the usual one, and a sample one step beside its request. The last few trips together define
// the usual one. Otherwise one late reply followed by a lost one would make all others look late by a period, each the
// answer to the request before.
constexpr float kOtherDelayCost = 10;
constexpr TimeNs kOtherDelayNs = 4 * kNsPerMs;
constexpr float kBesideCost = 6;

float DelayCost(TimeNs delay_ns, TimeNs usual_ns) {
  const TimeNs difference_ns = delay_ns > usual_ns ? delay_ns - usual_ns : usual_ns - delay_ns;
  return kOtherDelayCost * static_cast<float>(std::min(difference_ns, kOtherDelayNs)) /
         static_cast<float>(kOtherDelayNs);
}

// So many unusual round trips in a row, or more of them than others, are the new usual one.
constexpr int kUsualCount = 4;

// The prediction is lost after that many steps without sample, if then two thirds of the signals disagree.
constexpr ModelStep kBlindSteps = 25;
constexpr float kLostMisfit = kMisfitMax * 2 / 3;

}  // namespace

void ReplyMatcher::Request(ModelStep step, TimeNs sent_ns) {
  if (open_end_ - open_begin_ == kRequestCount) ++open_begin_;
  requests_[open_end_++ % kRequestCount] = {.step = step, .sent_ns = sent_ns};
}

std::optional<ModelStep> ReplyMatcher::Match(const MotionState& sample, TimeNs now, ModelStep now_step,
                                             MotionTimeline& timeline) {
  lost_ = false;
  answers_newest_ = skipped_ = false;
  const ModelStep oldest_step =
      std::max(timeline.last_sample_step() + 1, now_step - MotionTimeline::kStateCount / 2);
  while (open_begin_ != open_end_ && Open(open_begin_).step + 1 < oldest_step) ++open_begin_;
  timeline.At(std::max(now_step, timeline.last_sample_step()));

  std::optional<ModelStep> best_step;
  std::uint32_t best_number = 0;
  float best_cost = 0;
  for (std::uint32_t number = open_begin_; number != open_end_; ++number) {
    for (const ModelStep beside : {0, 1, -1}) {
      // Before its request only when that was, in truth, the one before, and late. On a line in time it would be a
      // push that looks like motion of less time, and all that follow would be stamped as much too early.
      if (beside < 0 && usual_ns_ < kModelStepNs) continue;
      const ModelStep step = Open(number).step + beside;
      if (step < oldest_step || step > now_step) continue;
      const float cost = Misfit(sample, timeline.At(step), timeline.last_sample()) +
                         DelayCost(now - Open(number).sent_ns, usual_ns_) + (beside == 0 ? 0 : kBesideCost);
      if (best_step && cost >= best_cost) continue;
      best_step = step;
      best_number = number;
      best_cost = cost;
    }
  }
  if (!best_step) return std::nullopt;
  if (best_cost > kLostMisfit && now_step - timeline.last_sample_step() > kBlindSteps) {
    lost_ = true;
    best_number = open_end_ - 1;
    best_step = std::max(std::min(Open(best_number).step, now_step), oldest_step);
  }
  NoteDelay(now - Open(best_number).sent_ns);
  answers_newest_ = best_number + 1 == open_end_;
  skipped_ = best_number != open_begin_;
  open_begin_ = best_number + 1;
  return best_step;
}

bool ReplyMatcher::Expects(TimeNs now, TimeNs limit_ns) const {
  if (open_begin_ == open_end_) return false;
  const TimeNs since_ns = now - Open(open_end_ - 1).sent_ns;
  return since_ns < usual_ns_ && usual_ns_ < limit_ns;
}

void ReplyMatcher::NoteDelay(TimeNs delay_ns) {
  const bool usual = DelayCost(delay_ns, usual_ns_) < kOtherDelayCost;
  if (usual) {
    usual_ns_ = delay_ns;
    if (usual_count_ < kUsualCount) ++usual_count_;
  } else if (--usual_count_ <= 0) {
    usual_ns_ = delay_ns;
    usual_count_ = 1;
  }
}

}  // namespace tiltproof::firmware
