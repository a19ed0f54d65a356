#include "harness/process/shared_processor.h"

#include "harness/process/affinity.h"

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
  AllowProcessors(other_, here);
  sched_setaffinity(0, sizeof(here), &here);
}

}  // namespace tiltproof::harness
