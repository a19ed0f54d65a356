// Messages of the DDS library on its log. Internal to this folder.
//
// The library has one log for the whole process, and a line for every packet that it cannot read. A sender of
// garbage could fill a terminal. So the first lines go to standard error, and the others are counted.
#pragma once

#include <mutex>
#include <string>
#include <string_view>

namespace tiltproof::dds {

// Lines of the library that are printed until the total is.
inline constexpr int kLibraryLinesShownMax = 3;

// Keeps the library's messages meanwhile, unprinted: a reason for an exception. From the first capture on, the
// library's log comes here and stays here. One at a time: a second one waits for the end of the first.
class LibraryCapture {
 public:
  LibraryCapture();
  ~LibraryCapture();
  LibraryCapture(const LibraryCapture&) = delete;
  LibraryCapture& operator=(const LibraryCapture&) = delete;

  // Each line after ": "; empty when the library said nothing.
  std::string text() const;

 private:
  static std::mutex one_at_a_time_;
  const std::lock_guard<std::mutex> lock_;
  std::string text_;
};

// A message of the library, in any of its threads and at any time. The library ends the process after a fatal one, so
// that one is always printed.
void OnLibraryMessage(std::string_view message, bool fatal);

// When a bus closes: how many lines were not printed, if any, and the next ones are printed again.
void PrintLibraryTotal();

}  // namespace tiltproof::dds
