// The messages between the harness and a program in lockstep (docs/program.md), as bytes. Here is the harness's side;
// firmware/tiltproof_program.h has the other one.
//
//   ProgramReader reader;
//   reader.Add(bytes);
//   while (const auto message = reader.Next()) Handle(*message);   // may throw BrokenProtocol
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "link/character.h"
#include "link/time.h"

namespace tiltproof::harness {

struct ProgramHello {
  std::vector<link::LineRate> uarts;  // main line, reference line, lines to other boards
  std::string firmware, dialect, parameters;
};

// Messages to the program. `ask`: the program must ask when bytes have left.
void AppendHello(const ProgramHello& hello, std::vector<std::uint8_t>& out);
void AppendBytes(int uart, TimeNs shown, std::span<const std::uint8_t> bytes, bool ask,
                 std::vector<std::uint8_t>& out);
void AppendGrant(TimeNs shown, bool ask, std::vector<std::uint8_t>& out);
void AppendReset(TimeNs shown, bool ask, std::vector<std::uint8_t>& out);
void AppendSent(int uart, TimeNs shown, std::vector<std::uint8_t>& out);
void AppendComputed(TimeNs shown, std::vector<std::uint8_t>& out);
void AppendEnd(std::vector<std::uint8_t>& out);

// A message from the program, that has passed all checks which need no more than itself.
struct ProgramMessage {
  enum class Kind : std::uint8_t {
    kReady = 0x81,
    kWaiting = 0x82,
    kTransmit = 0x83,
    kStatus = 0x84,
    kRole = 0x85,
    kLog = 0x86,
    kRefused = 0x87,
    kCompute = 0x88
  };
  Kind kind{};
  int number = 0;                                 // UART, role
  bool tells_status = false, tells_role = false;  // of ready
  bool ask = false;                               // of transmit
  TimeNs time_ns = 0;                             // of waiting, transmit, log, compute
  TimeNs length_ns = 0, deadline_ns = 0;          // of compute
  std::uint32_t version = 0;                      // of ready
  std::uint32_t supervisor_state = 0, failsafe_count = 0;
  std::span<const std::uint8_t> bytes;  // of transmit
  std::string_view text;                // of log, refused

  // bytes and text are valid until the reader's next call.
};

// The program sent what docs/program.md does not have: "kind 7 at byte 24 of what it sent: 00 00 ...".
struct BrokenProtocol : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class ProgramReader {
 public:
  // `uart_count`: of those on which the program may send.
  explicit ProgramReader(int uart_count = 2) : uart_count_(uart_count) {}

  void Add(std::span<const std::uint8_t> bytes);
  // The next whole message; nullopt: it has not come yet. Throws BrokenProtocol as soon as the beginning of a message is
  // none, and from then on.
  std::optional<ProgramMessage> Next();
  // True if all that came was taken.
  bool empty() const { return taken_ == bytes_.size(); }
  // Bytes that came, in all.
  std::uint64_t offset() const { return offset_ + bytes_.size(); }

 private:
  ProgramMessage Read(std::span<const std::uint8_t> head, std::span<const std::uint8_t> body) const;
  void CheckHead(std::span<const std::uint8_t> head) const;
  [[noreturn]] void Refuse(std::string_view what) const;

  int uart_count_;
  std::vector<std::uint8_t> bytes_;
  std::size_t taken_ = 0;     // of bytes_
  std::uint64_t offset_ = 0;  // of bytes_ in the stream
};

}  // namespace tiltproof::harness
