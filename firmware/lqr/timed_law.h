// The law of the build `lqr` on a processor that takes a time to compute it.
//
//   TimedLaw law(setup.table, 2'000'000, compute);   // such as HostPort::Compute (firmware/ports/host/host_port.h)
//   LqrApplication application(setup, law, port);
#pragma once

#include <span>
#include <utility>

#include "firmware/lqr/lqr_application.h"

namespace tiltproof::firmware {

class TimedLaw final : public CycleLaw {
 public:
  // `length`: of one step of the law on a sound processor (ns).
  TimedLaw(const LqrTable& table, TimeNs length, Compute compute)
      : law_(table), length_(length), compute_(std::move(compute)) {}

  TimeNs Step(const ControlPeriod& period, std::span<const float> sensed, const Reference& reference,
              std::span<float> command) override {
    law_.Step(sensed, reference, command);
    return compute_(period.now, length_, period.deadline);
  }

 private:
  LqrLaw law_;
  const TimeNs length_;
  const Compute compute_;
};

}  // namespace tiltproof::firmware
