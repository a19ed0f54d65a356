// Libraries built with -fsanitize=address or undefined: what they need to be loaded, and what they report.
//
//   PreloadSanitizer("decoder.so");     // may start this program again
//   AbortReport report;
//   report.Look(line);                  // each line that the library prints
//   std::string text = report.text();   // "ERROR: AddressSanitizer: heap-buffer-overflow in Decode decoder.c:33"
//
// A report ends the process that the library is in with SIGABRT, which a FirmwareGuard survives: this program sets that
// as the sanitizers' default. The environment (ASAN_OPTIONS, UBSAN_OPTIONS) comes before it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// AddressSanitizer must be in a process before everything else. When the library needs it, and it is not there, this
// puts the same program with the same arguments in this one's place, with LD_PRELOAD. Otherwise it returns. Throws
// std::runtime_error that says what to do when the sanitizer is not found.
void PreloadSanitizer(const std::filesystem::path& library);

// A process's reason to abort, from its output. It is in the sanitizers' reports, in the C library's last line (an
// assertion, a damaged stack guard, a damaged heap), and in what Python, Rust and Ada print of an exception.
class AbortReport {
 public:
  void Look(std::string_view line);
  // Without addresses, which differ from process to process; empty: there was none. Of several, the last.
  const std::string& text() const { return text_; }
  // True where the text says where in the firmware.
  bool names_place() const { return names_place_; }
  // The place alone: "decoder.c:33", or "decoder.so+0x1a2b" of a library without lines. Empty: not known.
  const std::string& place() const { return place_; }

 private:
  void SetPlace(std::string_view line);
  bool LookForTraceback(std::string_view line);

  std::string text_, place_;
  std::string frame_;  // of a traceback: the innermost place so far
  bool in_traceback_ = false;
  bool lacks_place_ = false, names_place_ = false;
};

}  // namespace tiltproof::harness
