#include "harness/client/rated_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "link/chunk.h"

namespace tiltproof::harness {

bool RatedLine::DamagesTransmitted() const {
  return !Agnostic() && (!rate_->Runs() || !Understands(LineBitNs(), kUsualTolerance, rate_->BitNs()));
}

bool RatedLine::DamagesReceived() const {
  return !Agnostic() && rate_->Runs() && !Understands(rate_->BitNs(), rate_->tolerance, LineBitNs());
}

std::string RatedLine::Trouble() const {
  if (!DamagesTransmitted() && !DamagesReceived()) return "";
  if (!rate_->Runs()) return "has no baud rate (BRR is 0)";
  return fmt::format("runs at {:.0f} baud ({:g} MHz / {})", rate_->Baud(),
                     static_cast<double>(rate_->clock_hz) / 1e6, rate_->clocks_per_bit);
}

TimeNs RatedLine::TransmitTime(std::size_t byte_count) const {
  const auto count = static_cast<std::int64_t>(byte_count);
  if (!DamagesTransmitted() || !rate_->Runs()) return link::BytesTime(baud_, count);
  return count * 10 * rate_->clocks_per_bit * kNsPerS / rate_->clock_hz;
}

std::optional<TimeNs> RatedLine::Transmit(TimeNs now, std::span<const std::uint8_t> bytes) {
  if (!DamagesTransmitted()) return now;
  if (!rate_->Runs()) return std::nullopt;  // it never leaves
  const TimeNs begin = std::max(now, transmitter_free_ns_);
  transmitter_free_ns_ = begin + TransmitTime(bytes.size());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    transmitted_.Put(begin + TransmitTime(i), bytes[i], rate_->BitNs());
  return std::nullopt;
}

std::vector<LineSampler::Received> RatedLine::TakeTransmitted(TimeNs until) {
  if (baud_ == 0) return {};
  return transmitted_.Take(std::max(until, transmitter_free_ns_), LineBitNs(), kUsualTolerance);
}

std::vector<LineSampler::Received> RatedLine::TakeReceived(TimeNs until) {
  if (Agnostic() || !rate_->Runs()) return {};
  return received_.Take(until, rate_->BitNs(), rate_->tolerance);
}

}  // namespace tiltproof::harness
