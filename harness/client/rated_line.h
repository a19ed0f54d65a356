// A serial line whose end on the board has its own rate: when bytes leave, and how they are received.
//
// While both rates agree within the receiver's tolerance, bytes pass whole and take the line's time. Beyond
// it they take the time of their sender's rate, and the receiver gets the result of sampling at the wrong
// rate (harness/emulator/line_sampler.h).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/emulator/line_sampler.h"
#include "harness/emulator/usart_rate.h"
#include "link/time.h"

namespace tiltproof::harness {

class RatedLine {
 public:
  // The rate of the line and of its other end; 0: an ideal line, on which rates do not matter.
  explicit RatedLine(std::int64_t baud) : baud_(baud) {}

  std::int64_t baud() const { return baud_; }
  void Program(const UsartRate& rate) { rate_ = rate; }
  // The defect of the programmed rate: "runs at 460526 baud"; empty when it is right.
  std::string Trouble() const;

  // The time that the board takes to send that many bytes.
  TimeNs TransmitTime(std::size_t byte_count) const;
  // The board gives bytes to its transmitter. Returns when they begin on the line; none when they do not pass
  // whole.
  std::optional<TimeNs> Transmit(TimeNs now, std::span<const std::uint8_t> bytes);
  // The bytes received in place of those that do not pass whole, up to `until`; no other byte is given to the
  // transmitter before that.
  std::vector<LineSampler::Received> TakeTransmitted(TimeNs until);

  // Bytes to the board: whether they do not pass whole; if so, the same in the other direction.
  bool DamagesReceived() const;
  void Receive(TimeNs begin_ns, std::uint8_t byte) { received_.Put(begin_ns, byte, LineBitNs()); }
  std::vector<LineSampler::Received> TakeReceived(TimeNs until);

 private:
  bool Agnostic() const { return baud_ == 0 || !rate_; }
  bool DamagesTransmitted() const;
  double LineBitNs() const { return 1e9 / static_cast<double>(baud_); }

  std::int64_t baud_;
  std::optional<UsartRate> rate_;
  TimeNs transmitter_free_ns_ = 0;
  LineSampler transmitted_, received_;
};

}  // namespace tiltproof::harness
