// A serial line whose end on the board has its own rate and format of characters: when bytes leave, and how they are
// received.
//
// While both rates agree within the receiver's tolerance and both formats in data and parity bits, bytes pass whole and
// take the line's time. Otherwise they take their sender's time, and the receiver gets the result of wrong sampling
// (harness/emulator/line_sampler.h). The number of stop bits does not matter, because receivers check the first one
// only (RM0090, section 30.3.3).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/emulator/line_sampler.h"
#include "harness/emulator/usart_rate.h"
#include "link/character.h"
#include "link/time.h"

namespace tiltproof::harness {

class RatedLine {
 public:
  // The line's rate and that of its other end. On an ideal line rates and formats do not matter.
  explicit RatedLine(const link::LineRate& line) : line_(line), format_(line.character) {}

  const link::LineRate& line() const { return line_; }
  void Program(const UsartRate& rate, const link::CharacterFormat& format) {
    rate_ = rate;
    format_ = format;
  }
  // The defect of the programmed rate and format, and the line's: "runs at 460526 baud, the main line at 921600"; empty
  // when they are right. `name`: of the line.
  std::string Trouble(std::string_view name) const;

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
  void Receive(TimeNs begin_ns, std::uint8_t byte, bool parity_error) {
    received_.Put(begin_ns, byte, LineBitNs(), line_.character, parity_error);
  }
  std::vector<LineSampler::Received> TakeReceived(TimeNs until);
  // The board's format: that of its USART.
  const link::CharacterFormat& format() const { return format_; }

 private:
  bool Agnostic() const { return line_.baud == 0 || !rate_; }
  bool SameContent() const {
    return format_.data_bits == line_.character.data_bits && format_.parity == line_.character.parity;
  }
  bool DamagesTransmitted() const;
  double LineBitNs() const { return 1e9 / static_cast<double>(line_.baud); }

  link::LineRate line_;
  link::CharacterFormat format_;
  std::optional<UsartRate> rate_;
  TimeNs transmitter_free_ns_ = 0;
  LineSampler transmitted_, received_;
};

}  // namespace tiltproof::harness
