// A serial line whose end on the board has a rate of its own: when bytes leave, and what is understood of them.
//
// As long as both rates agree within the receiver's tolerance, bytes pass whole and take the line's time. Beyond it
// they take that of their sender's rate, and are what sampling at the wrong rate makes of them (harness/emulator/line_sampler.h).
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
  // What is wrong with the programmed rate: "runs at 460526 baud"; empty when nothing is.
  std::string Trouble() const;

  // How long the board sends that many bytes.
  TimeNs TransmitTime(std::size_t byte_count) const;
  // The board gives bytes to its transmitter. When they begin on the line; none when they do not pass whole.
  std::optional<TimeNs> Transmit(TimeNs now, std::span<const std::uint8_t> bytes);
  // What became of those that do not, up to `until`, before which no other is given to the transmitter.
  std::vector<LineSampler::Received> TakeTransmitted(TimeNs until);

  // Bytes to the board: whether they do not pass whole, and then the same the other way.
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
