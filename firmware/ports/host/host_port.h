// The board of a firmware that is a library on this machine, behind the functions of firmware/tiltproof_client.h.
//
//   HostPort port(*host);
//   const TimeNs sent = port.Transmit(Uart::kMain, now, frame);
#pragma once

#include <cstdint>
#include <span>

#include "firmware/port.h"
#include "firmware/tiltproof_client.h"

namespace tiltproof::firmware {

class HostPort final : public Port {
 public:
  explicit HostPort(const TiltproofHost& host) : host_(host) {}

  TimeNs Transmit(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    return host_.transmit(host_.context, static_cast<int>(uart), now, bytes.data(), bytes.size());
  }
  void Log(TimeNs now, const char* text) override {
    if (host_.log != nullptr) host_.log(host_.context, now, text);
  }
  // TiltproofHost::compute: states that the firmware computes for `length` ns from `now` on. Returns when it ends.
  TimeNs Compute(TimeNs now, TimeNs length, TimeNs deadline) const {
    return host_.compute == nullptr ? now : host_.compute(host_.context, now, length, deadline);
  }

 private:
  const TiltproofHost host_;
};

}  // namespace tiltproof::firmware
