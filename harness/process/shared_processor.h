// Keeps the calling thread and another process on one processor of the machine, so that handing over between them is
// a plain switch. On two processors each hand-over wakes a sleeping processor, which costs more than what it does with
// its turn.
//
//   SharedProcessor together(pid);
//   for (;;) {
//     together.BeginTurn();
//     Wait();  // for what the other sends
//     together.EndTurn();
//   }
//
// The system still chooses the processor: from time to time the thread is free to move, and the other process follows
// to where the thread then runs. Where the system permits no such thing, nothing changes.
#pragma once

#include <sched.h>
#include <sys/types.h>

namespace tiltproof::harness {

class SharedProcessor {
 public:
  explicit SharedProcessor(pid_t other);
  // Lets the calling thread go. It must be the one that took turns.
  ~SharedProcessor();
  SharedProcessor(const SharedProcessor&) = delete;
  SharedProcessor& operator=(const SharedProcessor&) = delete;

  void BeginTurn();
  void EndTurn();

 private:
  void Stay() const;
  void LetGo() const;

  pid_t other_;
  cpu_set_t allowed_{};
  bool possible_ = false;
  unsigned turns_count_ = 0;
};

}  // namespace tiltproof::harness
