// A process that the harness starts tells through a pipe who it is on the bus. No other process can write to
// this pipe, whereas any process could use its name on the bus.
//
//   Introduction introduction;                       // the harness
//   ChildProcess node({.command = ..., .descriptors = {introduction.child_end()}});
//   introduction.Started();
//   if (const auto who = introduction.Participant()) circle.Admit(*who, "plant");
//
//   Introduce(bus.participant());                    // the node, once it is on the bus
#pragma once

#include <sys/types.h>

#include <array>
#include <optional>

#include "harness/dds/participant.h"

namespace tiltproof::harness {

class Introduction {
 public:
  // Throws std::runtime_error.
  Introduction();
  ~Introduction();
  Introduction(const Introduction&) = delete;
  Introduction& operator=(const Introduction&) = delete;

  // The child's first descriptor, 3.
  int child_end() const { return child_end_; }
  // Called when the child has its own copy.
  void Started();
  // The child's participant, once it has told it. Does not wait.
  std::optional<dds::Participant> Participant();
  // Waits for it, at most 10 s of the process's own time. Throws std::runtime_error when the process ends
  // instead; `pidfd` is readable then.
  dds::Participant Await(pid_t pid, int pidfd);

 private:
  int our_end_ = -1, child_end_ = -1;
  dds::Participant participant_;
  std::size_t read_bytes_ = 0;
};

// In a process that was started in this way.
void Introduce(const dds::Participant& participant);

}  // namespace tiltproof::harness
