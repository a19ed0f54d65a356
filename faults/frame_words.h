// The frames of frame.script as text: one word per frame, single spaces between words. A word is the frame's
// bytes as two lower-case hexadecimal digits each, or `-` for a frame that is left as it is.
//
//   const FrameWords words = ReadFrameWords("7e30cf307e - 7e7d7e");
//   if (!words.problem.empty()) Complain(words.problem);
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tiltproof::faults {

struct FrameWords {
  std::vector<std::vector<std::uint8_t>> frames;  // in the order of the words; no bytes: left as it is
  std::string problem;                            // why the text is none, and where; then there are no frames
};
FrameWords ReadFrameWords(std::string_view text);

}  // namespace tiltproof::faults
