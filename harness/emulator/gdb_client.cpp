#include "harness/emulator/gdb_client.h"

#include <fmt/format.h>

#include <charconv>
#include <numeric>
#include <string_view>
#include <utility>

namespace tiltproof::harness {
namespace {

// An answer to what we ask is a byte or two.
constexpr std::size_t kPacketBytesMax = 4096;
// Stops a board that runs (section E.9, "Interrupts").
constexpr char kInterrupt = '\x03';

std::string Framed(const std::string& packet) {
  const unsigned sum = std::accumulate(packet.begin(), packet.end(), 0U, [](unsigned total, char c) {
    return total + static_cast<unsigned char>(c);
  });
  return fmt::format("${}#{:02x}", packet, sum & 0xFFU);
}

std::span<const std::uint8_t> Bytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

GdbClient::GdbClient(boost::asio::io_context& loop, int socket, Lost lost)
    : port_(loop, socket, "the emulator's debugger port"), lost_callback_(std::move(lost)) {
  port_.Start([this](std::span<const std::uint8_t> bytes) { OnBytes(bytes); },
              [this](const std::string& reason) { Lose(reason); });
}

void GdbClient::Flip(std::vector<MemoryBit> bits, Done done) {
  jobs_.push_back({std::move(bits), std::move(done)});
  if (step_ == Step::kIdle) Begin();
}

std::chrono::nanoseconds GdbClient::Waiting() const {
  if (!asked_at_) return std::chrono::nanoseconds(0);
  return std::chrono::steady_clock::now() - *asked_at_;
}

// Any byte stops a running board, and is lost. The board then reports that it has stopped, before it answers
// the question. A board that is stopped only sends the answer.
void GdbClient::Begin() {
  flipped_.clear();
  error_.clear();
  was_running_ = false;
  port_.Write(Bytes(std::string_view(&kInterrupt, 1)));
  Ask(Step::kStop, "?");
}

void GdbClient::Ask(Step step, const std::string& packet) {
  step_ = step;
  acknowledged_ = false;
  asked_at_ = std::chrono::steady_clock::now();
  port_.Write(Bytes(Framed(packet)));
}

void GdbClient::AskNextBit() {
  const auto& bits = jobs_.front().bits;
  if (!error_.empty() || flipped_.size() == bits.size()) {
    if (!was_running_) return Finish();
    return Ask(Step::kContinue, "c");
  }
  Ask(Step::kRead, fmt::format("m{:x},1", bits[flipped_.size()].address));
}

void GdbClient::OnBytes(std::span<const std::uint8_t> bytes) {
  const std::weak_ptr<char> alive = alive_;
  for (const std::uint8_t byte : bytes) {
    const char c = static_cast<char>(byte);
    if (!packet_) {
      if (c == '$') packet_.emplace();
      if (c == '+') OnAcknowledged();
      if (c == '-') Lose("the emulator's debugger port takes no request: its checksum is wrong");
    } else if (checksum_digits_left_ > 0) {
      if (--checksum_digits_left_ == 0) {
        const std::string packet = *std::exchange(packet_, std::nullopt);
        // Every packet is to be acknowledged, or QEMU would not hear the next interrupt.
        port_.Write(Bytes("+"));
        OnPacket(packet);
      }
    } else if (c == '#') {
      checksum_digits_left_ = 2;
    } else {
      packet_->push_back(c);
      if (packet_->size() > kPacketBytesMax) Lose("the emulator's debugger port says more than was asked");
    }
    if (alive.expired() || lost_) return;
  }
}

void GdbClient::OnAcknowledged() {
  if (step_ == Step::kIdle) return;
  acknowledged_ = true;
  if (step_ == Step::kContinue) Finish();
}

void GdbClient::OnPacket(const std::string& packet) {
  if (!acknowledged_) {
    // It reports a stop: the one requested here, or, when nothing was requested, another one.
    was_running_ |= step_ == Step::kStop;
    return;
  }
  const auto& bits = jobs_.front().bits;
  if (step_ == Step::kStop) return AskNextBit();
  if (step_ == Step::kRead) {
    std::uint8_t value = 0;
    const auto [end, error] = std::from_chars(packet.data(), packet.data() + packet.size(), value, 16);
    const MemoryBit& bit = bits[flipped_.size()];
    if (packet.size() != 2 || error != std::errc() || end != packet.data() + 2) {
      error_ = fmt::format("there is no memory at 0x{:08x} ({})", bit.address, packet);
      return AskNextBit();
    }
    flipped_.push_back({bit.address, value, static_cast<std::uint8_t>(value ^ (1U << bit.bit))});
    return Ask(Step::kWrite, fmt::format("M{:x},1:{:02x}", bit.address, flipped_.back().after));
  }
  if (step_ == Step::kWrite) {
    if (packet != "OK") {
      error_ = fmt::format("the memory at 0x{:08x} cannot be written ({})", flipped_.back().address, packet);
      flipped_.pop_back();
    }
    AskNextBit();
  }
}

void GdbClient::Finish() {
  const Job job = std::move(jobs_.front());
  jobs_.pop_front();
  step_ = Step::kIdle;
  acknowledged_ = false;
  asked_at_.reset();
  const auto flipped = std::exchange(flipped_, {});
  const std::string error = std::exchange(error_, {});
  if (!jobs_.empty()) Begin();
  if (job.done) job.done(error, flipped);
}

void GdbClient::Lose(const std::string& why) {
  if (std::exchange(lost_, true)) return;
  if (lost_callback_) lost_callback_(why);
}

}  // namespace tiltproof::harness
