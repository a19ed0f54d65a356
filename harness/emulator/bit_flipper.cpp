#include "harness/emulator/bit_flipper.h"

#include <fmt/format.h>

#include <utility>

namespace tiltproof::harness {

BitFlipper::BitFlipper(boost::asio::io_context& loop, int socket, GdbClient::Lost lost)
    : gdb_(loop, socket, std::move(lost)) {}

void BitFlipper::Flip(std::vector<MemoryBit> bits, Done done) {
  jobs_.push_back({std::move(bits), std::move(done)});
  if (jobs_.size() == 1) Begin();
}

void BitFlipper::Begin() {
  flipped_.clear();
  error_.clear();
  gdb_.Stop([this](bool was_running) {
    was_running_ = was_running;
    FlipNext();
  });
}

void BitFlipper::FlipNext() {
  const auto& bits = jobs_.front().bits;
  if (!error_.empty() || flipped_.size() == bits.size()) {
    if (!was_running_) return Finish();
    return gdb_.Continue([this] { Finish(); });
  }
  const MemoryBit bit = bits[flipped_.size()];
  gdb_.Ask(fmt::format("m{:x},1", bit.address), [this, bit](const std::string& packet, const std::string&) {
    const auto value = HexBytes(packet);
    if (packet.size() == 2 && value.size() == 1)
      return Write({bit.address, value[0], static_cast<std::uint8_t>(value[0] ^ (1U << bit.bit))});
    error_ = fmt::format("there is no memory at 0x{:08x} ({})", bit.address, packet);
    FlipNext();
  });
}

void BitFlipper::Write(const FlippedByte& byte) {
  gdb_.Ask(fmt::format("M{:x},1:{:02x}", byte.address, byte.after),
           [this, byte](const std::string& packet, const std::string&) {
             if (packet == "OK")
               flipped_.push_back(byte);
             else
               error_ = fmt::format("the memory at 0x{:08x} cannot be written ({})", byte.address, packet);
             FlipNext();
           });
}

void BitFlipper::Finish() {
  const Job job = std::move(jobs_.front());
  jobs_.pop_front();
  const auto flipped = std::exchange(flipped_, {});
  const std::string error = std::exchange(error_, {});
  if (!jobs_.empty()) Begin();
  if (job.done) job.done(error, flipped);
}

}  // namespace tiltproof::harness
