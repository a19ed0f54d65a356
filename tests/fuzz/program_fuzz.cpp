// The reader of a program's messages (docs/program.md): any bytes are messages or are refused, in any pieces alike.
//
// Input: the size of a piece (one byte, 0: all at once), then what the program sends.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "harness/client/program_messages.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using tiltproof::harness::BrokenProtocol;
using tiltproof::harness::ProgramMessage;
using tiltproof::harness::ProgramReader;
using tiltproof::testing::Require;

struct Reading {
  std::vector<std::string> messages;
  std::string refusal;
  bool operator==(const Reading&) const = default;
};

std::string Shown(const ProgramMessage& message) {
  std::string text = std::to_string(static_cast<int>(message.kind));
  for (const std::int64_t number :
       {std::int64_t{message.number}, message.time_ns, message.length_ns, message.deadline_ns,
        std::int64_t{message.version}, std::int64_t{message.supervisor_state},
        std::int64_t{message.failsafe_count}})
    text += " " + std::to_string(number);
  text += message.ask ? " ask " : message.tells_status ? " status " : " ";
  text += message.text;
  return text.append(reinterpret_cast<const char*>(message.bytes.data()), message.bytes.size());
}

Reading Read(std::span<const std::uint8_t> stream, std::size_t piece) {
  Reading reading;
  ProgramReader reader;
  while (!stream.empty()) {
    const auto now = stream.first(std::min(piece, stream.size()));
    stream = stream.subspan(now.size());
    reader.Add(now);
    try {
      while (const auto message = reader.Next()) {
        Require(message->text.find('\0') == std::string_view::npos, "a text has no zero");
        Require(message->number >= 0 && message->number <= 2, "a UART or a role is one of the few");
        reading.messages.push_back(Shown(*message));
      }
    } catch (const BrokenProtocol& broken) {
      reading.refusal = broken.what();
      Require(!reading.refusal.empty(), "a refusal says why");
      return reading;
    }
  }
  return reading;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> stream(data + 1, size - 1);
  const Reading whole = Read(stream, stream.size());
  Require(Read(stream, data[0] == 0 ? 1 : data[0]) == whole, "pieces do not matter");
  return 0;
}
