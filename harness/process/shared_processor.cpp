#include "harness/process/shared_processor.h"

#include <charconv>
#include <filesystem>
#include <string>
#include <system_error>

namespace tiltproof::harness {
namespace {

// Between two choices of a processor: some tenths of a second.
constexpr unsigned kTurns = 2000;

// Where the thread may run, whoever else has it stay somewhere: as it was when this was first asked.
const cpu_set_t& AllowedToThisThread() {
  thread_local const cpu_set_t allowed = [] {
    cpu_set_t set;
    CPU_ZERO(&set);
    sched_getaffinity(0, sizeof(set), &set);
    return set;
  }();
  return allowed;
}

}  // namespace

SharedProcessor::SharedProcessor(pid_t other)
    : other_(other), allowed_(AllowedToThisThread()), possible_(CPU_COUNT(&allowed_) > 1) {}

SharedProcessor::~SharedProcessor() {
  if (possible_) LetGo();
}

void SharedProcessor::BeginTurn() {
  if (possible_ && turns_count_ == 0) LetGo();
}

void SharedProcessor::EndTurn() {
  if (possible_ && turns_count_ == 0) Stay();
  turns_count_ = (turns_count_ + 1) % kTurns;
}

void SharedProcessor::LetGo() const { sched_setaffinity(0, sizeof(allowed_), &allowed_); }

void SharedProcessor::Stay() const {
  const int processor = sched_getcpu();
  if (processor < 0 || processor >= CPU_SETSIZE) return;
  cpu_set_t here;
  CPU_ZERO(&here);
  CPU_SET(processor, &here);
  // All of its threads. One may begin or end meanwhile; it is found the next time.
  std::error_code none;
  for (std::filesystem::directory_iterator thread("/proc/" + std::to_string(other_) + "/task", none), end;
       !none && thread != end; thread.increment(none)) {
    const std::string name = thread->path().filename();
    pid_t id = 0;
    if (std::from_chars(name.data(), name.data() + name.size(), id).ec == std::errc())
      sched_setaffinity(id, sizeof(here), &here);
  }
  sched_setaffinity(0, sizeof(here), &here);
}

}  // namespace tiltproof::harness
