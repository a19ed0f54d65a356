// The arguments of the plug-in: socket=3,barrier=126,main=2,reference=3,console=1,hse=8000000 (lockstep_plugin.cpp says
// what they are).
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "harness/emulator/frame_end_text.h"
#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/clock_tree.h"

namespace tiltproof::qemu {

struct Arguments {
  int socket = -1;
  std::optional<link::FrameEnd> barrier;                                     // on the main line
  std::array<int, harness::lockstep::kConnectedUsartCount> usart_numbers{};  // on the chip, by Usart; 0: none
  std::uint32_t hse_hz = ClockTree::kUsualHseHz;  // of the board's crystal; 0: there is none
  bool ideal = false;                             // lines without byte time
  bool realtime = false;                          // only the chip: no socket, no barrier
  int memory = -1;                                // in real time: a descriptor for RealtimeBoard
  std::uint32_t word_at = 0, word = 0;  // the word is written there before the first instruction; 0: none
  bool debugged = false;                // a debugger may set breakpoints
  int coverage = -1;                    // a descriptor for BlockCounts; -1: nothing is counted
};

// "" or what is wrong with them.
inline std::string Parse(int argc, char** argv, Arguments& arguments) {
  constexpr std::array<std::string_view, harness::lockstep::kConnectedUsartCount> kLines = {
      "main", "reference", "console", "line0", "line1", "line2"};
  for (int i = 0; i < argc; ++i) {
    const std::string_view argument = argv[i];
    const std::size_t equals = argument.find('=');
    const std::string_view key = argument.substr(0, equals);
    const std::string_view value = equals == argument.npos ? "" : argument.substr(equals + 1);
    const auto line = std::find(kLines.begin(), kLines.end(), key);
    const bool digit = value.size() == 1 && value[0] >= '0' && value[0] <= '9';
    std::uint32_t number = 0;
    const auto parsed = std::from_chars(value.data(), value.data() + value.size(), number);
    const bool is_number =
        !value.empty() && parsed.ec == std::errc() && parsed.ptr == value.data() + value.size();
    if (key == "socket" && digit) {
      arguments.socket = value[0] - '0';
    } else if (key == "memory" && digit) {
      arguments.memory = value[0] - '0';
    } else if (key == "coverage" && digit) {
      arguments.coverage = value[0] - '0';
    } else if (key == "barrier" && harness::ParseFrameEnd(value)) {
      arguments.barrier = harness::ParseFrameEnd(value);
    } else if (line != kLines.end() && digit) {
      arguments.usart_numbers[static_cast<std::size_t>(line - kLines.begin())] = value[0] - '0';
    } else if (key == "hse" && is_number) {
      arguments.hse_hz = number;
    } else if (key == "word_at" && is_number) {
      arguments.word_at = number;
    } else if (key == "word" && is_number) {
      arguments.word = number;
    } else if (key == "ideal" && value == "on") {
      arguments.ideal = true;
    } else if (key == "debugged" && value == "on") {
      arguments.debugged = true;
    } else if (key == "realtime" && value == "on") {
      arguments.realtime = true;
    } else {
      return "unknown argument " + std::string(argument);
    }
  }
  if (!arguments.realtime && (arguments.socket < 0 || !arguments.barrier))
    return "socket=DESCRIPTOR or barrier=END is missing";
  return "";
}

}  // namespace tiltproof::qemu
