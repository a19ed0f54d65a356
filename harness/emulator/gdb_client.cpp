#include "harness/emulator/gdb_client.h"

#include <fmt/format.h>

#include <charconv>
#include <numeric>
#include <string_view>
#include <utility>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

// QEMU's own limit is 4096.
constexpr std::size_t kPacketBytesMax = 4096;
// The acknowledgement of a packet that an earlier client left, then the interrupt (section E.9, "Interrupts").
constexpr std::string_view kInterrupt = "+\x03";

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

std::vector<std::uint8_t> HexBytes(std::string_view digits) {
  std::vector<std::uint8_t> bytes;
  for (; digits.size() >= 2; digits.remove_prefix(2)) {
    std::uint8_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + 2, value, 16);
    if (error != std::errc() || end != digits.data() + 2) break;
    bytes.push_back(value);
  }
  return bytes;
}

std::string HexDigits(std::string_view bytes) {
  std::string digits;
  for (const char byte : bytes) digits += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return digits;
}

GdbClient::GdbClient(boost::asio::io_context& loop, int socket, Lost lost)
    : port_(loop, socket, "the emulator's debugger port"), lost_callback_(std::move(lost)) {
  port_.Start([this](std::span<const std::uint8_t> bytes) { OnBytes(bytes); },
              [this](const std::string& reason) { Lose(reason); });
}

// Any byte stops a running board, and is lost. The board then reports that it has stopped, before it answers
// the question. A board that is stopped only sends the answer.
void GdbClient::Stop(Stopped stopped) {
  reported_stop_ = false;
  port_.Write(Bytes(kInterrupt));
  Request("?", [this, stopped = std::move(stopped)](const std::string&, const std::string&) {
    stopped(reported_stop_);
  });
}

void GdbClient::Ask(const std::string& packet, Answer answer) { Request(packet, std::move(answer)); }

void GdbClient::Continue(std::function<void()> accepted) {
  Request("c", [accepted = std::move(accepted)](const std::string&, const std::string&) { accepted(); });
  ends_when_acknowledged_ = true;
}

std::chrono::nanoseconds GdbClient::Waiting() const {
  if (!asked_at_) return std::chrono::nanoseconds(0);
  return std::chrono::steady_clock::now() - *asked_at_;
}

void GdbClient::Request(const std::string& packet, Answer answer) {
  Check(!answer_, "the debugger port is asked one thing at a time");
  answer_ = std::move(answer);
  ends_when_acknowledged_ = false;
  acknowledged_ = false;
  output_.clear();
  asked_at_ = std::chrono::steady_clock::now();
  port_.Write(Bytes(Framed(packet)));
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
  if (!answer_) return;
  acknowledged_ = true;
  if (ends_when_acknowledged_) Finish("");
}

void GdbClient::OnPacket(const std::string& packet) {
  if (!acknowledged_) {
    // It reports a stop: the one requested here, or, when nothing was requested, another one.
    reported_stop_ = true;
  } else if (packet.starts_with('O') && packet != "OK") {
    const auto bytes = HexBytes(std::string_view(packet).substr(1));
    output_.append(bytes.begin(), bytes.end());
  } else {
    Finish(packet);
  }
}

void GdbClient::Finish(const std::string& packet) {
  acknowledged_ = false;
  asked_at_.reset();
  const Answer answer = std::exchange(answer_, nullptr);
  const std::string output = std::exchange(output_, {});
  answer(packet, output);
}

void GdbClient::Lose(const std::string& why) {
  if (std::exchange(lost_, true)) return;
  if (lost_callback_) lost_callback_(why);
}

}  // namespace tiltproof::harness
