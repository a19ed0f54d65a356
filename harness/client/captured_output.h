// Captures what this process prints, on standard output and error, from now on: for foreign code that runs in
// it.
//
//   CapturedOutput output;  CallFirmware();  output.TakeLines([&](std::string line) { log(line); });
//
// Printing never blocks: output that does not fit the buffer (1 MiB between two calls of TakeLines) is lost.
#pragma once

#include <functional>
#include <string>

#include "harness/client/line_splitter.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

class CapturedOutput {
 public:
  CapturedOutput();
  // Restores the streams.
  ~CapturedOutput();
  CapturedOutput(const CapturedOutput&) = delete;
  CapturedOutput& operator=(const CapturedOutput&) = delete;

  using OnLine = std::function<void(std::string)>;
  void TakeLines(const OnLine& on_line);
  // Also the last line, even if it has no end.
  void TakeAll(const OnLine& on_line);

 private:
  link::OwnedDescriptor output_, error_;  // as they were
  link::OwnedDescriptor pipe_;
  LineSplitter lines_;
};

}  // namespace tiltproof::harness
