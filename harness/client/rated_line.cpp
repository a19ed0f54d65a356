#include "harness/client/rated_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tiltproof::harness {

bool RatedLine::DamagesTransmitted() const {
  return !Agnostic() &&
         (!rate_->Runs() || !SameContent() || !Understands(LineBitNs(), kUsualTolerance, rate_->BitNs()));
}

bool RatedLine::DamagesReceived() const {
  return !Agnostic() && rate_->Runs() &&
         (!SameContent() || !Understands(rate_->BitNs(), rate_->tolerance, LineBitNs()));
}

std::string RatedLine::Trouble(std::string_view name) const {
  if (Agnostic()) return "";
  const std::string line = fmt::format(", the {} line at {}", name, line_.baud);
  if (!rate_->Runs()) return "has no baud rate (BRR is 0)" + line;
  if (!Understands(LineBitNs(), kUsualTolerance, rate_->BitNs()) ||
      !Understands(rate_->BitNs(), rate_->tolerance, LineBitNs()))
    return fmt::format("runs at {:.0f} baud ({:g} MHz / {}){}", rate_->Baud(),
                       static_cast<double>(rate_->clock_hz) / 1e6, rate_->clocks_per_bit, line);
  if (format_ == line_.character) return "";
  return fmt::format("is set to {}, the {} line to {} (link.data_bits, parity and stop_bits)",
                     link::Name(format_), name, link::Name(line_.character));
}

TimeNs RatedLine::TransmitTime(std::size_t byte_count) const {
  const auto count = static_cast<std::int64_t>(byte_count);
  if (!DamagesTransmitted() || !rate_->Runs()) return line_.BytesTime(count);
  return count * format_.bit_count() * rate_->clocks_per_bit * kNsPerS / rate_->clock_hz;
}

std::optional<TimeNs> RatedLine::Transmit(TimeNs now, std::span<const std::uint8_t> bytes) {
  if (!DamagesTransmitted()) return now;
  if (!rate_->Runs()) return std::nullopt;  // it never leaves
  const TimeNs begin = std::max(now, transmitter_free_ns_);
  transmitter_free_ns_ = begin + TransmitTime(bytes.size());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    transmitted_.Put(begin + TransmitTime(i), bytes[i], rate_->BitNs(), format_);
  return std::nullopt;
}

std::vector<LineSampler::Received> RatedLine::TakeTransmitted(TimeNs until) {
  if (line_.baud == 0) return {};
  return transmitted_.Take(std::max(until, transmitter_free_ns_), LineBitNs(), kUsualTolerance,
                           line_.character);
}

std::vector<LineSampler::Received> RatedLine::TakeReceived(TimeNs until) {
  if (Agnostic() || !rate_->Runs()) return {};
  return received_.Take(until, rate_->BitNs(), rate_->tolerance, format_);
}

}  // namespace tiltproof::harness
