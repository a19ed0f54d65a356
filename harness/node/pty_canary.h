// Measures how late this machine's pseudo-terminals are. A kernel thread with ordinary priority carries what
// is written at one end to the other. On a busy machine that takes milliseconds, which no clock of the
// harness would show and for which the firmware would be blamed.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "harness/node/node.h"
#include "link/pty.h"

namespace tiltproof::harness {

class PtyCanary {
 public:
  explicit PtyCanary(NodeServices& services)
      : services_(services),
        pty_(services.loop()),
        far_(services.loop(), pty_.slave_path(), LinkSpec::kDefaultBaud),
        timer_(services, services.clock().Now() + kPeriodNs, kPeriodNs, [this](BootTime now) { Send(now); }) {
    far_.Start([this](std::span<const std::uint8_t>) { Arrive(); }, [](const std::string&) {});
    pty_.master().Start([](std::span<const std::uint8_t>) {}, [](const std::string&) {});
  }

 private:
  static constexpr TimeNs kPeriodNs = 4 * kNsPerMs;

  void Send(BootTime now) {
    if (sent_ns_ != BootTime::Never()) return;
    sent_ns_ = now;
    constexpr std::array<std::uint8_t, 1> kByte = {0x55};
    pty_.master().Write(kByte);
  }
  void Arrive() {
    if (sent_ns_ != BootTime::Never()) services_.lateness().Note(sent_ns_, services_.clock().Now());
    sent_ns_ = BootTime::Never();
  }

  NodeServices& services_;
  link::Pty pty_;
  link::SerialPort far_;
  BootTime sent_ns_ = BootTime::Never();
  PeriodicTimer timer_;
};

}  // namespace tiltproof::harness
