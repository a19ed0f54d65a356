// Activity 1 of 4: gets the sensors, as client of the service "read sensors" (paper, section 2.1, Figures 3
// and 4).
//
//   reader.Request(now);                  // at the start of each period
//   reader.Receive(bytes);                // as they arrive
//   if (auto sensors = reader.TakeReply()) ...
//
// A reply carries no number that links it to its request, so the first valid reply after a request is taken
// as its answer, even if it is a late answer to an earlier request; whatever follows it in the same period is
// dropped. There is at most one answer per request.
#pragma once

#include <optional>
#include <span>

#include "firmware/messages.h"
#include "firmware/port.h"
#include "link/frame.h"

namespace tiltproof::firmware {

// What a receiver requires of a payload besides a right checksum and exact length.
enum class ValueChecks : std::uint8_t {
  kNone,            // trust the checksum, as the paper does: NaN and absurd values pass
  kFiniteAndRange,  // every value finite and plausible (ranges in firmware/messages.h)
};

class SensorReader {
 public:
  // `port` must outlive the reader.
  SensorReader(link::Dialect dialect, ValueChecks checks, Port& port);

  // Drops what was received so far, a half-received frame included, and asks the server for the sensors.
  void Request(TimeNs now);

  void Receive(std::span<const std::uint8_t> bytes);

  // The answer to the last request, once.
  std::optional<Sensors> TakeReply();

  // True from a request until its answer has been received.
  bool waiting() const { return waiting_; }

 private:
  bool Accept(std::span<const std::uint8_t> payload);

  link::Dialect dialect_;
  ValueChecks checks_;
  Port& port_;
  link::FrameDecoder decoder_;
  bool waiting_ = false;
  bool has_reply_ = false;
  Sensors reply_;
};

}  // namespace tiltproof::firmware
