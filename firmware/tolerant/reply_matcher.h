// Finds the instant that a reply shows. Replies carry no number, and may be late, out of order or repeated. So the
// matcher compares all 16 signals with the predicted motion at the requests that are still open.
//
//   matcher.Request(step, now);                                       // for each request that is sent
//   if (const auto step = matcher.Match(sample, now, now_step, timeline)) timeline.Correct(*step, sample);
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware/tolerant/motion_timeline.h"

namespace tiltproof::firmware {

class ReplyMatcher {
 public:
  // `step` is the one that a request without delay shows.
  void Request(ModelStep step, TimeNs sent_ns);

  // The step that `sample` shows, newer than the timeline's last sample; nullopt when it answers nothing that is
  // open. A match closes its request and all before it. When nothing fits and the timeline is blind for long, the
  // newest request counts.
  std::optional<ModelStep> Match(const MotionState& sample, TimeNs now, ModelStep now_step,
                                 MotionTimeline& timeline);

  // For the first reply: it closes all requests, because without a prediction it cannot be matched. Otherwise the next
  // reply could count as the answer to a request that the first one has answered, and all later ones as late.
  void CloseAll() { open_begin_ = open_end_; }

  // True if the last match took the newest request because nothing fitted: the prediction was lost.
  bool lost() const { return lost_; }
  // True if the last match answered the newest request.
  bool answers_newest() const { return answers_newest_; }
  // True if the last match left out an older request: that one, or its reply, was lost.
  bool skipped() const { return skipped_; }

  // True if the usual time of the newest request's reply is still to come, and before `limit_ns` after the request.
  bool Expects(TimeNs now, TimeNs limit_ns) const;

 private:
  static constexpr std::size_t kRequestCount = 32;
  struct OpenRequest {
    ModelStep step = 0;
    TimeNs sent_ns = 0;
  };
  void NoteDelay(TimeNs delay_ns);
  const OpenRequest& Open(std::uint32_t number) const { return requests_[number % kRequestCount]; }

  std::array<OpenRequest, kRequestCount> requests_{};
  std::uint32_t open_begin_ = 0, open_end_ = 0;  // numbers of the open ones
  TimeNs usual_ns_ = 0;                          // round trip
  int usual_count_ = 0;                          // of the last matches that had it, less the others
  bool lost_ = false;
  bool answers_newest_ = false;
  bool skipped_ = false;
};

}  // namespace tiltproof::firmware
