// A process that a run starts and answers for: nodes of the harness, and the user's own firmware commands. It
// never outlives this object, nor this process - not even when this process is killed with SIGKILL - and what
// it started in turn goes with it.
//
//   ChildProcess node({.command = {"tiltproof", "node", "plant"}, .error = log_file});
//   loop.Watch(node.pidfd(), ...);                         // readable when it has ended
//   if (!node.Alive()) Report(*node.ExitText());           // "exited with code 3", "killed by signal 9
//   (Killed)" node.Stop(500ms);                                      // SIGTERM, then SIGKILL; the destructor
//   does it too
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

// There is no such program, here or in PATH.
struct NoSuchProgram : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct ChildSpec {
  // Where a stream goes, when it is no descriptor of ours.
  static constexpr int kInherit = -1;  // where ours goes
  static constexpr int kPipe = -2;     // to us: ChildProcess::output(), error()
  static constexpr int kNull = -3;     // nowhere

  std::vector<std::string> command = {};  // program (looked up in PATH), arguments
  std::vector<std::pair<std::string, std::string>> environment = {};  // added to ours, or instead of ours
  int output = kInherit;
  int error = kInherit;
  // Inherited as descriptors 3, 4, ... in this order; no other is, whatever its flags. Standard input is
  // /dev/null.
  std::vector<int> descriptors = {};
  // For commands of users, which start processes of their own (`sh -c "a | b"`). When our process is killed,
  // the kernel kills the child alone; a guard, a process beside it, then kills the rest of its group.
  bool guard_group = false;
};

class ChildProcess {
 public:
  // Returns once the program runs: in a process group of its own, with default signal dispositions and none
  // blocked. Throws std::runtime_error that names the program and says why it cannot be started.
  explicit ChildProcess(const ChildSpec& spec);
  // Stop() with kGrace.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  static constexpr std::chrono::milliseconds kGrace{500};

  pid_t pid() const { return pid_; }
  // Readable (poll, epoll) once the process has ended; valid as long as this object.
  int pidfd() const { return pidfd_; }
  // Read ends of its pipes, non-blocking; -1 for a stream that is none.
  int output() const { return output_; }
  int error() const { return error_; }

  bool Alive();
  // How it ended; nullopt while it lives.
  std::optional<std::string> ExitText();

  // To the process alone, or to its whole group (SIGSTOP, SIGCONT, ...). Nothing happens once it is stopped.
  void Signal(int number);
  void SignalGroup(int number);

  // Asks the group to end (SIGTERM, and SIGCONT in case it is paused), waits up to `grace` for the process,
  // kills (SIGKILL) what is left of the group, and reaps. Blocks for `grace` and a moment at most.
  void Stop(std::chrono::milliseconds grace);

 private:
  ChildProcess(const ChildSpec& spec, bool outlives_us);
  bool WaitEnd(std::chrono::milliseconds timeout) const;

  pid_t pid_ = -1;
  int pidfd_ = -1;
  int output_ = -1;
  int error_ = -1;
  // The process stays a zombie until Stop(), so that its id, and its group's, cannot become somebody else's.
  bool reaped_ = false;
  std::optional<std::string> exit_text_;

  std::unique_ptr<ChildProcess> guard_;
  int guard_line_ = -1;  // the guard sees it closed when we die
};

// Lets the calling process be killed (SIGKILL) as soon as the thread that started it ends; at once when
// `parent`, the process that started it, is gone already. For processes made by a bare fork().
// Async-signal-safe.
void DieWithParent(pid_t parent);

}  // namespace tiltproof::harness
