// Ctrl-C while flights are under way: they end in order, and the command reports what it has.
//
//   const InterruptScope scope;
//   Engine engine({.interrupted = InterruptScope::flag()});
#pragma once

#include <atomic>
#include <csignal>

namespace tiltproof::harness {

// Puts handlers of SIGINT, SIGTERM and SIGHUP in place for as long as it lives. Scopes may nest: what came in the outer
// one holds in the inner one.
class InterruptScope {
 public:
  InterruptScope();
  ~InterruptScope();
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;

  // As one of these signals does.
  static void Interrupt();
  // Set by these signals; cleared when an outermost scope begins.
  static const std::atomic<bool>* flag();

 private:
  struct sigaction old_int_ {};
  struct sigaction old_term_ {};
  struct sigaction old_hangup_ {};
  struct sigaction old_child_ {};
};

}  // namespace tiltproof::harness
