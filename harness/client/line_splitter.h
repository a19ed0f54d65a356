// Cuts a stream of bytes into text lines for a log: without control characters that a terminal would obey,
// and of limited length.
//
//   LineSplitter lines;
//   lines.Add(bytes, log);  // log(std::string line)
//   lines.End(log);         // what is left without a line end
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

namespace tiltproof::harness {

class LineSplitter {
 public:
  static constexpr std::size_t kLineBytesMax = 1000;

  template <class OnLine>
  void Add(std::string_view bytes, const OnLine& on_line) {
    for (const char c : bytes) {
      const bool end = c == '\n';
      if (!end) partial_.push_back(IsControl(c) ? '?' : c);
      if (end || partial_.size() == kLineBytesMax) Cut(on_line);
    }
  }
  template <class OnLine>
  void End(const OnLine& on_line) {
    if (!partial_.empty()) Cut(on_line);
  }

 private:
  // A tab is text; a carriage return may end a text line of a serial console.
  static bool IsControl(char c) { return (c >= 0 && c < 0x20 && c != '\t' && c != '\r') || c == 0x7F; }

  template <class OnLine>
  void Cut(const OnLine& on_line) {
    std::string line = std::exchange(partial_, {});
    while (line.ends_with('\r')) line.pop_back();
    for (char& c : line)
      if (c == '\r') c = '?';
    on_line(std::move(line));
  }

  std::string partial_;
};

}  // namespace tiltproof::harness
