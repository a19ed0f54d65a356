// Activity 1 of 4: gets the sensors, as client of the service "read sensors" (paper, section 2.1, Figures 3
// and 4).
//
//   reader.Request(now);                  // at the start of each period
//   reader.Receive(bytes);                // as they arrive
//   if (auto sensors = reader.TakeReply()) ...
//
// A reply carries no number that links it to its request, so the first valid reply after a request is taken
// as its answer, even if it is a late answer to an earlier request; whatever follows it in the same period is
// dropped. There is at most one answer per request. With LateReplies::kKept, every valid reply is passed on. In the
// dialect `hardened` replies are numbered: a repeated or older one is not valid.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "firmware/frame_sender.h"
#include "firmware/messages.h"
#include "firmware/port.h"
#include "link/frame.h"

namespace tiltproof::firmware {

// A receiver's requirements on a payload besides a right checksum and exact length.
enum class ValueChecks : std::uint8_t {
  kNone,  // trust the checksum, as the paper does: NaN and absurd values pass
  // Every value finite and plausible (ranges in firmware/messages.h). Of a reply, two values may be otherwise: they
  // become NaN.
  kFiniteAndRange,
};

// Treatment of a reply that is not the first since the last request.
enum class LateReplies : std::uint8_t {
  kDropped,  // as in the paper
  kKept,     // so that the control activity can find out what it shows
};

class SensorReader {
 public:
  // `port` must outlive the reader.
  SensorReader(link::Dialect dialect, ValueChecks checks, LateReplies late_replies, Port& port);

  // Asks the server for the sensors. kDropped: drops what was received so far, a half-received frame included.
  void Request(TimeNs now);

  void Receive(std::span<const std::uint8_t> bytes);

  // The next reply that has not been taken. kDropped: the answer to the last request.
  std::optional<Sensors> TakeReply();

  // When the last request's last bit leaves.
  TimeNs sent_ns() const { return sent_ns_; }

  // True from a request until its answer has been received.
  bool waiting() const { return waiting_; }

 private:
  void Accept(std::span<const std::uint8_t> payload);

  ValueChecks checks_;
  FrameSender sender_;
  link::FrameDecoder decoder_;
  link::HeaderFilter filter_;
  LateReplies late_replies_;
  TimeNs sent_ns_ = 0;
  bool waiting_ = false;
  std::array<Sensors, 4> replies_;  // received and not taken, in order
  std::size_t reply_count_ = 0;
};

}  // namespace tiltproof::firmware
