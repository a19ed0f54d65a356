#include "harness/emulator/diagnosis/gdb_board.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <utility>

namespace tiltproof::harness {
namespace {

int Duplicate(int socket) {
  const int copy = fcntl(socket, F_DUPFD_CLOEXEC, 0);
  if (copy < 0)
    throw EmulatorTrouble(fmt::format("the emulator's debugger port is closed: {}", std::strerror(errno)));
  return copy;
}

}  // namespace

GdbBoard::GdbBoard(int socket, const lockstep::UsartStates& usarts, std::chrono::milliseconds limit)
    : usarts_(usarts),
      until_(std::chrono::steady_clock::now() + limit),
      gdb_(loop_, Duplicate(socket), [this](const std::string& why) { lost_ = why; }) {
  gdb_.Stop([this](bool) { reply_.emplace(); });
  Await();
}

std::string GdbBoard::Registers() {
  std::string text = Ask("qRcmd," + HexDigits("info registers")).output;
  std::erase(text, '\r');
  return text;
}

std::vector<std::uint8_t> GdbBoard::ReadMemory(std::uint32_t address, std::uint32_t size) {
  const std::string digits = Ask(fmt::format("m{:x},{:x}", address, size)).packet;
  // "E14" where there is none: three characters are no bytes.
  return digits.size() % 2 == 0 ? HexBytes(digits) : std::vector<std::uint8_t>();
}

bool GdbBoard::Step() { return Ask("s").packet.starts_with('T'); }

void GdbBoard::WriteCode(std::uint32_t address, std::uint32_t word) {
  const auto bytes = std::bit_cast<std::array<char, sizeof word>>(word);
  Ask(fmt::format("M{:x},{:x}:{}", address, sizeof word, HexDigits({bytes.data(), bytes.size()})));
}

GdbBoard::Reply GdbBoard::Ask(const std::string& packet) {
  gdb_.Ask(packet, [this](const std::string& answer, const std::string& output) {
    reply_.emplace(Reply{answer, output});
  });
  return Await();
}

GdbBoard::Reply GdbBoard::Await() {
  while (!reply_) {
    if (!lost_.empty()) throw EmulatorTrouble(lost_);
    if (loop_.run_one_until(until_) == 0)
      throw EmulatorTrouble("the emulator's debugger port does not answer");
  }
  return *std::exchange(reply_, std::nullopt);
}

}  // namespace tiltproof::harness
