// Kind and place of a firmware's failure, as data: code that groups flights uses it, and reads no sentence.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "link/fields.h"

namespace tiltproof::harness {

enum class FirmwareEndKind : std::uint8_t {
  kInOwnCode,  // a fatal signal, an exception, exit(), a call that does not return; a fault or a hang on a board
  kInCallBack,  // a fatal signal while the harness computed for a call back: memory that the firmware damaged
  kInThread,    // in a thread that it started
  kTooCostly,   // an image took more of the emulator's processor time than its limit
};
constexpr std::string_view Name(FirmwareEndKind kind) {
  switch (kind) {
    case FirmwareEndKind::kInOwnCode:
      return "own_code";
    case FirmwareEndKind::kInCallBack:
      return "call_back";
    case FirmwareEndKind::kInThread:
      return "thread";
    case FirmwareEndKind::kTooCostly:
      return "too_costly";
  }
  return "unknown";
}
constexpr FirmwareEndKind LastOf(FirmwareEndKind) { return FirmwareEndKind::kTooCostly; }

struct FirmwareEnd {
  FirmwareEndKind kind = FirmwareEndKind::kInOwnCode;
  // The place in a library: "decoder.c:33", "decoder.so+0x1a2b", or "stack overflow in Decode", because the place where a
  // recursion meets the end of its stack is chance. Empty: not known.
  std::string place = {};
  friend bool operator==(const FirmwareEnd&, const FirmwareEnd&) = default;
  TILTPROOF_FIELDS(kind, place)
};

// The firmware under test did something forbidden: its own fault, never the harness's.
struct FirmwareTrouble : std::runtime_error {
  FirmwareTrouble(bool hung_in, const std::string& text, FirmwareEnd end_in = {})
      : std::runtime_error(text), hung(hung_in), end(std::move(end_in)) {}
  bool hung;  // otherwise crashed
  FirmwareEnd end;
};

}  // namespace tiltproof::harness
