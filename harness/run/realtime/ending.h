// Decides how a real-time flight ends, and what caused it. Several nodes may report the same failure, and
// those affected by a dead node often report before its death is seen.
//
//   ending.Hear(EndReason::kNodeLost, "the plant's port is gone", sim_ns, now);   // a node's report
//   ending.Settle(now, members.AnySilent());                                      // on every turn
//   ending.End(EndReason::kNodeLost, "the link node was killed", sim_ns);         // seen by the harness
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "harness/run/run_log.h"

namespace tiltproof::harness {

class Ending {
 public:
  using Clock = std::chrono::steady_clock;
  // The wait before Settle() believes a node's report that something went away. When a node dies, others see
  // its ports close a moment before the harness sees its end or misses its heartbeat.
  static constexpr std::chrono::milliseconds kHearsayLimit{250};

  bool ended() const { return reason_.has_value(); }
  EndReason reason() const { return reason_.value_or(EndReason::kHarnessError); }
  const std::string& text() const { return text_; }
  TimeNs end_ns() const { return end_ns_; }

  // The first reason counts, except for a failure that shows only after the vehicle's flight was over.
  void End(EndReason reason, const std::string& text, TimeNs end_ns) {
    const auto of_vehicle = [](EndReason r) {
      return r == EndReason::kCompleted || r == EndReason::kDiverged || r == EndReason::kGroundStrike ||
             r == EndReason::kNeverStarted;
    };
    if (reason_ && (!of_vehicle(*reason_) || of_vehicle(reason))) return;
    if (!reason_) end_ns_ = end_ns;
    reason_ = reason;
    text_ = text;
  }
  // Overrides any earlier reason.
  void Interrupt(TimeNs end_ns) {
    if (!reason_) end_ns_ = end_ns;
    reason_ = EndReason::kInterrupted;
    text_ = "interrupted";
  }

  // Keeps the first report of a node until Settle().
  void Hear(EndReason reason, const std::string& text, TimeNs sim_ns, Clock::time_point now) {
    if (!heard_) heard_ = {reason, text, sim_ns, now};
  }
  // Believes a kept report when its time has come. `silent`: a node is silent and may be the cause of the
  // report; that shows before long.
  void Settle(Clock::time_point now, bool silent) {
    if (heard_ && !silent && now >= heard_->at + kHearsayLimit) Believe();
  }
  // At once: nothing more can become known.
  void Believe() {
    if (heard_) End(heard_->reason, heard_->text, heard_->sim_ns);
    heard_.reset();
  }

 private:
  struct Heard {
    EndReason reason;
    std::string text;
    TimeNs sim_ns;
    Clock::time_point at;
  };
  std::optional<Heard> heard_;
  std::optional<EndReason> reason_;
  std::string text_;
  TimeNs end_ns_ = 0;
};

}  // namespace tiltproof::harness
