#include "harness/cli/interrupt_scope.h"

namespace tiltproof::harness {
namespace {

std::atomic<bool> interrupted{false};
int scopes_count = 0;

void OnInterrupt(int) { interrupted.store(true, std::memory_order_relaxed); }

}  // namespace

InterruptScope::InterruptScope() {
  if (scopes_count++ == 0) interrupted = false;
  struct sigaction action {};
  action.sa_handler = OnInterrupt;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, &old_int_);
  sigaction(SIGTERM, &action, &old_term_);
  sigaction(SIGHUP, &action, &old_hangup_);
  // Inherited as ignored, it would let the kernel reap our workers before we have seen how they ended.
  action.sa_handler = SIG_DFL;
  sigaction(SIGCHLD, &action, &old_child_);
}

InterruptScope::~InterruptScope() {
  --scopes_count;
  sigaction(SIGINT, &old_int_, nullptr);
  sigaction(SIGTERM, &old_term_, nullptr);
  sigaction(SIGHUP, &old_hangup_, nullptr);
  sigaction(SIGCHLD, &old_child_, nullptr);
}

void InterruptScope::Interrupt() { OnInterrupt(SIGINT); }

const std::atomic<bool>* InterruptScope::flag() { return &interrupted; }

}  // namespace tiltproof::harness
