// The build `lqr` as a whole: the paper's periodic cycle (section 2.1, Figure 4) with messages of the vehicle's sizes.
//
//   LqrApplication application(table, link::Dialect::kPaper, port);
//   TimeNs wake = application.Start(now);            // power-on
//   for (;;) {                                       // until `wake` or until bytes arrive
//     application.Receive(Uart::kMain, bytes);
//     wake = application.Tick(now);
//   }
//
// It sends `start`, then one request in each period. The first valid reply to a request is answered at once by
// actuators. A reply that is damaged, not finite or implausible is none, and its period has no actuators. Until the
// first valid reply each period begins with `start` again, because the server may not have received it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "firmware/lqr/lqr_law.h"
#include "firmware/messages.h"
#include "firmware/port.h"
#include "firmware/reference_receiver.h"
#include "link/frame.h"

namespace tiltproof::firmware {

class LqrApplication {
 public:
  // `table` and `port` must outlive the application.
  LqrApplication(const LqrTable& table, link::Dialect dialect, Port& port);

  // Power-on, once. Returns when to call Tick at the latest.
  TimeNs Start(TimeNs now);
  // Bytes from a receiver, in order, in any pieces. Decodes only; Tick acts on what has arrived.
  void Receive(Uart uart, std::span<const std::uint8_t> bytes);
  // Does all that is due at `now`, which does not decrease. Returns when to call again at the latest.
  TimeNs Tick(TimeNs now);

 private:
  struct Services {
    float start, read, actuators;
    bool start_has_inputs;
  };

  // Returns when the message's last bit has left.
  TimeNs Send(TimeNs now, float id, std::span<const float> values);
  TimeNs SendStart(TimeNs now);
  void BeginPeriod(TimeNs now);
  void AcceptReply(std::span<const std::uint8_t> payload);
  void Answer(TimeNs now);

  const LqrTable& table_;
  const Services services_;
  const TimeNs period_ns_;
  Port& port_;
  LqrLaw law_;
  link::FrameDecoder decoder_;
  ReferenceReceiver reference_receiver_;
  std::optional<Reference> reference_;  // the last one received; before that, the place of the first reply
  std::array<float, kLqrSensedMax> sensed_{};
  bool has_reply_ = false;      // in sensed_, not answered
  bool waiting_ = false;        // for the reply to the last request
  bool start_is_fresh_ = true;  // `start` has been sent and no request since
  bool heard_server_ = false;   // a valid reply has arrived
  TimeNs next_request_ns_ = 0;
};

}  // namespace tiltproof::firmware
