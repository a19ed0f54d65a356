// How a process that we start tells us who it is on the bus: through a pipe, on which nobody else can speak. Anybody
// could take its name on the bus.
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
  // The child has its own copy now.
  void Started();
  // Who the child is, once it has said it. Does not wait.
  std::optional<dds::Participant> Participant();
  // Waits for it, 10 s of the process's own time at most. Throws std::runtime_error when it ends instead; `pidfd` is
  // readable then.
  dds::Participant Await(pid_t pid, int pidfd);

 private:
  int our_end_ = -1, child_end_ = -1;
  dds::Participant participant_;
  std::size_t read_bytes_ = 0;
};

// In a process that was started so.
void Introduce(const dds::Participant& participant);

}  // namespace tiltproof::harness
