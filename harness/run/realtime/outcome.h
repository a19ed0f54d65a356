// How a flight in real time ends, and who is to blame: several nodes may speak of one trouble, and those who
// suffer from a dead node often speak before its death is seen.
//
//   outcome.Hear(EndReason::kNodeLost, "the plant's port is gone", sim_ns, now);   // a node's word
//   outcome.Settle(now, members.AnySilent());                                      // on every turn
//   outcome.End(EndReason::kNodeLost, "the link node was killed", sim_ns);         // seen by ourselves
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "harness/run/run_log.h"

namespace tiltproof::harness {

class Outcome {
 public:
  using Clock = std::chrono::steady_clock;
  // Before a node is believed that something went away from it: when a node dies, others see its ports close a
  // moment before we see its end, or miss its heartbeat.
  static constexpr std::chrono::milliseconds kHearsayLimit{250};

  bool ended() const { return reason_.has_value(); }
  EndReason reason() const { return reason_.value_or(EndReason::kHarnessError); }
  const std::string& text() const { return text_; }
  TimeNs end_ns() const { return end_ns_; }

  // The first reason counts, but for trouble that shows only after the vehicle's flight was over.
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
  // Whatever came before.
  void Interrupt(TimeNs end_ns) {
    if (!reason_) end_ns_ = end_ns;
    reason_ = EndReason::kInterrupted;
    text_ = "interrupted";
  }

  // The first that a node tells is kept, until Settle().
  void Hear(EndReason reason, const std::string& text, TimeNs sim_ns, Clock::time_point now) {
    if (!heard_) heard_ = {reason, text, sim_ns, now};
  }
  // Believes what was heard when its time has come. `silent`: a node is not heard, and may be what the others
  // suffer from; that shows before long.
  void Settle(Clock::time_point now, bool silent) {
    if (heard_ && !silent && now >= heard_->at + kHearsayLimit) Believe();
  }
  // At once: nothing more can show.
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
