// A process that a run starts and is responsible for: nodes of the harness, and the user's own firmware
// commands. It never outlives this object, nor this process - not even when this process is killed with
// SIGKILL - and the processes that it started end with it.
//
//   ChildProcess node({.command = {"tiltproof", "node", "plant"}, .error = log_file});
//   loop.Watch(node.pidfd(), ...);                         // readable when it has ended
//   if (!node.Alive()) Report(*node.ExitText());           // "exited with code 3", "killed by signal 9 (Killed)"
//   node.Stop(500ms);                                      // SIGTERM, then SIGKILL; the destructor does it too
//
// Started by vfork and execve, not posix_spawn: only so can every child ask the kernel to die with its parent
// (PR_SET_PDEATHSIG) without the help of a program in between. Between the two only system calls are made, so
// threads do no harm. One trap of the kernel's: the "parent" is the *thread* that started the child; start
// children from one that lives as long as they should.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace tiltproof::harness {

// There is no such program, neither at this path nor in PATH.
struct NoSuchProgram : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct ChildSpec {
  // Where a stream goes, when it is not a descriptor.
  static constexpr int kInherit = -1;  // where this process's stream goes
  static constexpr int kPipe = -2;     // to this process: ChildProcess::output(), error()
  static constexpr int kNull = -3;     // nowhere

  std::vector<std::string> command = {};  // program (looked up in PATH), arguments
  std::vector<std::pair<std::string, std::string>> environment =
      {};  // adds to or replaces inherited variables
  int output = kInherit;
  int error = kInherit;
  // Inherited as descriptors 3, 4, ... in this order; no others are, whatever their flags. Standard input is
  // /dev/null.
  std::vector<int> descriptors = {};
  // For users' commands, which start their own processes (`sh -c "a | b"`). When this process is killed, the
  // kernel kills only the child; a guard, which is a process of its own, then kills the rest of its group.
  bool guard_group = false;
};

class ChildProcess {
 public:
  // Returns once the program runs: in its own process group, with default signal dispositions and none
  // blocked. Throws std::runtime_error that names the program and says why it cannot be started.
  explicit ChildProcess(const ChildSpec& spec);
  // Stop() with kGrace.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  static constexpr std::chrono::milliseconds kGrace{500};

  pid_t pid() const { return pid_; }
  // Readable (poll, epoll) once the process has ended; valid as long as this object exists.
  int pidfd() const { return pidfd_; }
  // Read ends of its pipes, non-blocking; -1 for a stream that is not a pipe.
  int output() const { return output_; }
  int error() const { return error_; }

  bool Alive();
  // The end of the process in words ("exited with code 1"); nullopt while it lives.
  std::optional<std::string> ExitText();

  // Sends a signal only to the process, or to its whole group (SIGSTOP, SIGCONT, ...). No effect once it is
  // stopped.
  void Signal(int number);
  void SignalGroup(int number);

  // Asks the group to end (SIGTERM, and SIGCONT in case it is paused), waits up to `grace` for the process,
  // kills (SIGKILL) what is left of the group, and reaps. Blocks for at most `grace` and a moment.
  void Stop(std::chrono::milliseconds grace);

 private:
  ChildProcess(const ChildSpec& spec, bool outlives_us);
  void Run(const ChildSpec& spec, bool outlives_us, int guard_line);
  void EndGuard();
  bool WaitEnd(std::chrono::milliseconds timeout) const;

  pid_t pid_ = -1;
  int pidfd_ = -1;
  int output_ = -1;
  int error_ = -1;
  // The process stays a zombie until Stop(), so that its id, and its group's, cannot be reused by another
  // process.
  bool reaped_ = false;
  std::optional<std::string> exit_text_;

  std::unique_ptr<ChildProcess> guard_;
  int guard_line_ = -1;  // the guard sees it closed when this process dies
};

// Has the calling process killed (SIGKILL) as soon as the thread that started it ends; at once when `parent`,
// the process that started it, is gone already. For processes made by a bare fork(). Async-signal-safe.
void DieWithParent(pid_t parent);

}  // namespace tiltproof::harness
