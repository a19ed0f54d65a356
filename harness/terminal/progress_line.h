// The line on standard error that says how far a command is, written over and over while it works. Only on a
// terminal: elsewhere it would fill a log.
//
//   ProgressLine line(true);
//   line.Show("3 of 38 flights, 1 not green, 2 min 5 s left");
//   line.Clear();  // before anything else is printed
#pragma once

#include <optional>
#include <string>

namespace tiltproof::harness {

class ProgressLine {
 public:
  explicit ProgressLine(bool wanted);
  ~ProgressLine() { Clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // True if Show shows anything.
  bool visible() const { return visible_; }
  // Cut where the terminal ends.
  void Show(const std::string& text);
  void Clear();

 private:
  bool visible_;
  std::string shown_;
};

// The time until all is done, when `share` (0 to 1) of it took `passed_s` and the rest takes as long in proportion.
// None while too little is done to tell.
std::optional<double> TimeLeft(double share, double passed_s);

// "8 s", "2 min 5 s", "1 h 10 min": rounded up, as a person reads it.
std::string DurationText(double seconds);

}  // namespace tiltproof::harness
