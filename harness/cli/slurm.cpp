#include "harness/cli/slurm.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "harness/cli/commands.h"
#include "harness/process/child_process.h"

namespace tiltproof::harness {
namespace {

// A command that has ended.
struct SlurmAnswer {
  std::string output, error;
  bool good = false;
  std::string how;  // "exited with code 1"
};

// Appends what can be read now. False: the other end was closed.
bool ReadSome(int file, std::string& text) {
  std::array<char, 4096> part{};
  for (;;) {
    const ssize_t count = read(file, part.data(), part.size());
    if (count > 0) text.append(part.data(), static_cast<std::size_t>(count));
    if (count == 0) return false;
    if (count < 0 && errno != EINTR) return errno == EAGAIN || errno == EWOULDBLOCK;
  }
}

// Slurm's commands give up by themselves when their server does not answer.
SlurmAnswer RunSlurm(const std::vector<std::string>& command) {
  std::optional<ChildProcess> child;
  try {
    child.emplace(ChildSpec{.command = command, .output = ChildSpec::kPipe, .error = ChildSpec::kPipe});
  } catch (const NoSuchProgram&) {
    throw UsageError(
        fmt::format("--executor slurm: this machine has no {}: install Slurm's commands (Debian: "
                    "slurm-client), or fly here (--executor local)",
                    command.front()));
  }
  SlurmAnswer ended;
  bool output_open = true, error_open = true;
  while (output_open || error_open) {
    std::array<pollfd, 2> files = {pollfd{output_open ? child->output() : -1, POLLIN, 0},
                                   pollfd{error_open ? child->error() : -1, POLLIN, 0}};
    if (poll(files.data(), files.size(), -1) < 0) continue;
    if (files[0].revents != 0) output_open = ReadSome(child->output(), ended.output);
    if (files[1].revents != 0) error_open = ReadSome(child->error(), ended.error);
  }
  pollfd end{child->pidfd(), POLLIN, 0};
  while (poll(&end, 1, -1) < 0) {
  }
  ended.how = child->ExitText().value_or("");
  ended.good = ended.how == "exited with code 0";
  return ended;
}

[[noreturn]] void ThrowRefusal(const std::string& program, const SlurmAnswer& ended) {
  std::string reason = ended.error.empty() ? ended.output : ended.error;
  while (!reason.empty() && reason.back() == '\n') reason.pop_back();
  throw std::runtime_error(fmt::format("{} {}: {}", program, ended.how, reason));
}

// In a pattern for the names of logs.
std::string InPattern(const std::string& path) {
  std::string text;
  for (const char c : path) text += c == '%' ? "%%" : std::string(1, c);
  return text;
}

}  // namespace

std::string RangesText(const std::vector<std::uint64_t>& numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += text.empty() ? "" : ",";
    text += last > i ? fmt::format("{}-{}", numbers[i], numbers[last]) : std::to_string(numbers[i]);
    i = last + 1;
  }
  return text;
}

std::uint64_t SubmitArray(const SlurmArray& array) {
  std::vector<std::string> command = {
      "sbatch",
      "--parsable",
      "--requeue",
      "--open-mode=truncate",
      "--array=" + RangesText(array.numbers),
      "--job-name=" + array.name,
      fmt::format("--output={}/{}", InPattern(array.log.parent_path().string()),
                  array.log.filename().string())};
  if (array.processors > 1) command.push_back(fmt::format("--cpus-per-task={}", array.processors));
  command.push_back(array.script.string());
  const SlurmAnswer ended = RunSlurm(command);
  std::uint64_t job = 0;
  // "17", or "17;cluster".
  const char* begin = ended.output.data();
  const auto [end, error] = std::from_chars(begin, begin + ended.output.size(), job);
  if (!ended.good || error != std::errc()) ThrowRefusal("sbatch", ended);
  return job;
}

SlurmStates StatesOf(std::uint64_t job) {
  // All of this user: Slurm forgets jobs that ended, and takes it for a mistake to ask for one.
  const SlurmAnswer ended =
      RunSlurm({"squeue", "--noheader", "--array", fmt::format("--user={}", getuid()), "--format=%F %T"});
  if (!ended.good) ThrowRefusal("squeue", ended);
  SlurmStates states;
  std::istringstream lines(ended.output);
  std::uint64_t array = 0;
  for (std::string state; lines >> array >> state;) {
    if (array != job) continue;
    const bool waits = state == "PENDING" || state == "REQUEUED" || state == "REQUEUE_HOLD" ||
                       state == "SPECIAL_EXIT" || state == "SUSPENDED";
    ++(waits ? states.waiting : states.flying);
  }
  return states;
}

}  // namespace tiltproof::harness
