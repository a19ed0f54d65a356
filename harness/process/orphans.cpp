#include "harness/process/orphans.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <system_error>
#include <vector>

namespace tiltproof::harness {
namespace {

std::mutex kept_mutex;
std::vector<pid_t> kept;

bool IsKept(pid_t child) {
  const std::lock_guard lock(kept_mutex);
  return std::find(kept.begin(), kept.end(), child) != kept.end();
}

// Children of all threads of this process, except those that are kept.
std::vector<pid_t> Orphans() {
  std::vector<pid_t> orphans;
  std::error_code none;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task", none)) {
    std::ifstream list(thread.path() / "children");
    for (pid_t child = 0; list >> child;)
      if (!IsKept(child)) orphans.push_back(child);
  }
  return orphans;
}

}  // namespace

void AdoptOrphans() { prctl(PR_SET_CHILD_SUBREAPER, 1); }

void KeepChild(pid_t child) {
  const std::lock_guard lock(kept_mutex);
  kept.push_back(child);
}

void ForgetChild(pid_t child) {
  const std::lock_guard lock(kept_mutex);
  std::erase(kept, child);
}

void ReapOrphans() {
  for (const pid_t orphan : Orphans()) waitpid(orphan, nullptr, WNOHANG);
}

void EndOrphans() {
  constexpr std::chrono::seconds kLimit{1};
  const auto end = std::chrono::steady_clock::now() + kLimit;
  for (std::vector<pid_t> orphans = Orphans(); !orphans.empty(); orphans = Orphans()) {
    for (const pid_t orphan : orphans) kill(orphan, SIGKILL);
    for (const pid_t orphan : orphans) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      if (left.count() <= 0) return;
      pollfd ended{static_cast<int>(syscall(SYS_pidfd_open, orphan, 0)), POLLIN, 0};
      poll(&ended, 1, static_cast<int>(left.count()));
      if (ended.fd >= 0) close(ended.fd);
      waitpid(orphan, nullptr, WNOHANG);
    }
  }
}

OrphanScope::OrphanScope() : others_(Orphans()) {
  prctl(PR_GET_CHILD_SUBREAPER, &adopted_);
  AdoptOrphans();
  for (const pid_t other : others_) KeepChild(other);
}

OrphanScope::~OrphanScope() {
  EndOrphans();
  for (const pid_t other : others_) ForgetChild(other);
  prctl(PR_SET_CHILD_SUBREAPER, adopted_);
}

}  // namespace tiltproof::harness
