#include "harness/emulator/gdb_board.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <numeric>
#include <string_view>
#include <utility>

#include "harness/emulator/cpu_state.h"
#include "harness/emulator/fault_registers.h"

namespace tiltproof::harness {
namespace {

using std::chrono::steady_clock;

std::vector<std::uint8_t> FromHex(std::string_view digits) {
  std::vector<std::uint8_t> bytes;
  for (; digits.size() >= 2; digits.remove_prefix(2)) {
    std::uint8_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + 2, value, 16);
    if (error != std::errc() || end != digits.data() + 2) break;
    bytes.push_back(value);
  }
  return bytes;
}

std::string ToHex(std::string_view bytes) {
  std::string digits;
  for (const char byte : bytes) digits += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return digits;
}

}  // namespace

// Any byte stops a running board, and is lost. It then reports that it has stopped. Whatever it reported before is
// acknowledged by the first byte, or is not waited for any more with the first packet.
GdbBoard::GdbBoard(int socket, const lockstep::UsartStates& usarts, std::chrono::milliseconds limit)
    : socket_(socket), usarts_(usarts), until_(steady_clock::now() + limit) {
  Write("+\x03");
  Ask("?");
}

std::string GdbBoard::Registers() {
  std::string text;
  // Output comes in pieces, before "OK".
  for (std::string packet = Ask("qRcmd," + ToHex("info registers")); packet != "OK"; packet = NextPacket()) {
    if (!packet.starts_with('O')) return text;
    const auto bytes = FromHex(std::string_view(packet).substr(1));
    text.append(bytes.begin(), bytes.end());
  }
  std::erase(text, '\r');
  return text;
}

std::vector<std::uint8_t> GdbBoard::ReadMemory(std::uint32_t address, std::uint32_t size) {
  // "E14" where there is none.
  return FromHex(Ask(fmt::format("m{:x},{:x}", address, size)));
}

bool GdbBoard::Step() { return Ask("s").starts_with('T'); }

void GdbBoard::WriteCode(std::uint32_t address, std::uint32_t word) {
  const auto bytes = std::bit_cast<std::array<char, sizeof word>>(word);
  Ask(fmt::format("M{:x},{:x}:{}", address, sizeof word, ToHex({bytes.data(), bytes.size()})));
}

std::string GdbBoard::Ask(const std::string& packet) {
  const unsigned sum = std::accumulate(packet.begin(), packet.end(), 0U, [](unsigned total, char c) {
    return total + static_cast<unsigned char>(c);
  });
  Write(fmt::format("${}#{:02x}", packet, sum & 0xFFU));
  // Bytes before the acknowledgement of the request are an older report.
  for (char c = NextByte(); c != '+'; c = NextByte()) {
  }
  return NextPacket();
}

std::string GdbBoard::NextPacket() {
  while (NextByte() != '$') {
  }
  std::string packet;
  for (char c = NextByte(); c != '#'; c = NextByte()) packet += c;
  NextByte();
  NextByte();
  // Or QEMU would not hear the next request.
  Write("+");
  return packet;
}

char GdbBoard::NextByte() {
  while (taken_ == in_.size()) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until_ - steady_clock::now());
    pollfd polled{socket_, POLLIN, 0};
    if (left.count() <= 0 || poll(&polled, 1, static_cast<int>(left.count())) == 0)
      throw EmulatorTrouble("the emulator's debugger port does not answer");
    std::array<char, 4096> buffer;
    const ssize_t got = recv(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (got <= 0) throw EmulatorTrouble("the emulator's debugger port is closed");
    in_.assign(buffer.data(), static_cast<std::size_t>(got));
    taken_ = 0;
  }
  return in_[taken_++];
}

void GdbBoard::Write(const std::string& bytes) {
  // Far less than a socket holds.
  if (send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(bytes.size()))
    throw EmulatorTrouble("the emulator's debugger port is closed");
}

LockedUpBoard::LockedUpBoard(std::string registers, const lockstep::LastWords& words)
    : registers_(std::move(registers)), words_(words) {
  if (const auto state = ParseCpuState(registers_)) stack_ = state->stack_pointer();
}

std::vector<std::uint8_t> LockedUpBoard::ReadMemory(std::uint32_t address, std::uint32_t size) {
  const auto part = [&](const auto& words, std::uint32_t begin) {
    std::vector<std::uint8_t> bytes(sizeof words);
    std::memcpy(bytes.data(), words, sizeof words);
    bytes.erase(bytes.begin(), bytes.begin() + (address - begin));
    bytes.resize(std::min<std::size_t>(bytes.size(), size));
    return bytes;
  };
  if (address - kFaultRegisters < sizeof words_.faults) return part(words_.faults, kFaultRegisters);
  if (address - stack_ < sizeof words_.stack) return part(words_.stack, stack_);
  return {};
}

}  // namespace tiltproof::harness
