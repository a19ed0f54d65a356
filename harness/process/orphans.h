// Ends the processes that a firmware leaves behind, whatever group or session they are in.
//
//   AdoptOrphans();         // early: from now on they come to this process when their parents end
//   KeepChild(pid);         // one that this program has started
//   EndOrphans();           // all other children
#pragma once

#include <sys/types.h>

#include <vector>

namespace tiltproof::harness {

// Makes this process the parent of descendants whose parents end (PR_SET_CHILD_SUBREAPER). Its children do not inherit
// that.
void AdoptOrphans();

void KeepChild(pid_t child);
// It has been reaped.
void ForgetChild(pid_t child);

// Kills (SIGKILL) and reaps all children that are not kept, and those that become children by that. Takes at most a
// second. Does nothing where /proc does not list children.
void EndOrphans();
// Reaps those of them that have ended.
void ReapOrphans();

// For a moment in a process that may have other children: ends those that come to it meanwhile, and no others.
class OrphanScope {
 public:
  OrphanScope();
  ~OrphanScope();
  OrphanScope(const OrphanScope&) = delete;
  OrphanScope& operator=(const OrphanScope&) = delete;

 private:
  int adopted_ = 0;            // before: whether orphans came to this process
  std::vector<pid_t> others_;  // children that it had
};

}  // namespace tiltproof::harness
