#include "harness/cli/campaign_cluster.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <vector>

#include "harness/cli/client_flag.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/slurm.h"
#include "harness/report/files.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Slurm starts about one task per second and core: a task is to fly for minutes.
constexpr std::uint64_t kTaskRuns = 500;
// Slurm's arrays have at most 1001 numbers from 0 unless its administrator allows more.
constexpr std::uint64_t kTasksMax = 1000;
// Between two questions to Slurm, which serves many users.
constexpr std::chrono::seconds kAskLeast{2}, kAskMost{15};
// A signal ends the wait.
constexpr int kPause_ms = 100;

constexpr const char* kRunsKey = "runs_count";

std::uint64_t RunsOf(const CampaignStore& store) { return std::stoull(store.Meta(kRunsKey).value_or("0")); }

fs::path JobFile(const fs::path& folder) { return TasksFolder(folder) / "job"; }

// The last array that was submitted.
std::optional<std::uint64_t> LastJob(const fs::path& folder) {
  if (!fs::exists(JobFile(folder))) return {};
  try {
    return std::stoull(ReadFile(JobFile(folder)));
  } catch (const std::logic_error&) {
    return {};
  }
}

fs::path WriteScript(const fs::path& folder, int jobs_count) {
  const fs::path script = TasksFolder(folder) / "task.sh";
  WriteFile(script,
            fmt::format("#!/bin/sh\n# One task of the campaign; Slurm says which.\nexec {} campaign task "
                        "{} \"$SLURM_ARRAY_TASK_ID\" -j {}\n",
                        Quoted(fs::read_symlink("/proc/self/exe").string()),
                        Quoted(fs::absolute(folder).string()), jobs_count));
  chmod(script.c_str(), 0755);
  return script;
}

class ClusterFlights {
 public:
  ClusterFlights(CampaignStore& store, const ClusterFlying& flying)
      : store_(store), flying_(flying), runs_count_(RunsOf(store)) {
    Plan();
  }

  bool Fly() {
    std::optional<std::size_t> left_before;
    for (;;) {
      if (const auto job = LastJob(flying_.folder); job && !WaitFor(*job)) return false;
      GatherTasks(store_, flying_.folder);
      const std::vector<std::uint64_t> left = TasksToFly(store_.FlownNumbers(), tasks_.count, runs_count_);
      if (left.empty()) return true;
      if (left_before && left.size() >= *left_before) return Lost(left);
      left_before = left.size();
      Submit(left);
    }
  }

 private:
  // A campaign that goes on has its tasks already, so that their logs keep their numbers.
  void Plan() {
    if (fs::exists(TasksFolder(flying_.folder) / "plan.json")) {
      tasks_ = ReadTasks(flying_.folder);
      if (!flying_.options.task_runs) return;
    }
    const std::uint64_t least = (runs_count_ + kTasksMax - 1) / kTasksMax;
    const std::uint64_t of_task = std::max(flying_.options.task_runs.value_or(kTaskRuns), least);
    tasks_ = {.meta = store_.AllMeta(), .count = (runs_count_ + of_task - 1) / of_task};
    WriteTasks(flying_.folder, tasks_);
  }

  void Submit(const std::vector<std::uint64_t>& numbers) const {
    const fs::path folder = fs::absolute(TasksFolder(flying_.folder));
    const std::uint64_t job = SubmitArray({.script = WriteScript(flying_.folder, flying_.options.jobs_count),
                                           .numbers = numbers,
                                           .name = flying_.name,
                                           .log = folder / "task-%a.log",
                                           .processors = flying_.options.jobs_count});
    WriteFile(JobFile(flying_.folder), fmt::format("{}\n", job));
    flying_.tell(fmt::format("Slurm's job {}: {} of {} tasks", job, numbers.size(), tasks_.count));
  }

  // False: interrupted.
  bool WaitFor(std::uint64_t job) {
    auto ask_every = std::chrono::milliseconds(kAskLeast);
    Clock::time_point asked = Clock::now() - ask_every;
    for (bool told = false;;) {
      if (*InterruptScope::flag()) {
        flying_.tell(fmt::format("Slurm's job {} goes on; `scancel {}` ends it", job, job));
        return false;
      }
      if (Clock::now() - asked >= ask_every) {
        try {
          const SlurmStates states = StatesOf(job);
          if (!states.any()) return true;
          GatherTasks(store_, flying_.folder);
          flying_.on_turn(fmt::format("{} of {} runs, {} tasks fly, {} wait (Slurm's job {})", store_.Count(),
                                      runs_count_, states.flying, states.waiting, job));
          told = false;
        } catch (const FileError&) {
          throw;
        } catch (const std::runtime_error& error) {
          // Its server may be restarted meanwhile, and the tasks go on.
          if (!told) flying_.tell(fmt::format("Slurm cannot be asked, and is asked again: {}", error.what()));
          told = true;
        }
        asked = Clock::now();
        ask_every = std::min(ask_every * 3 / 2, std::chrono::milliseconds(kAskMost));
      }
      poll(nullptr, 0, kPause_ms);
    }
  }

  bool Lost(const std::vector<std::uint64_t>& left) const {
    flying_.tell(
        fmt::format("campaign: {} of {} tasks ended without a result, twice; see {}/task-{}.log, and go on "
                    "with --resume {}",
                    left.size(), tasks_.count, TasksFolder(flying_.folder).string(), left.front(),
                    flying_.folder.string()));
    return false;
  }

  CampaignStore& store_;
  const ClusterFlying& flying_;
  std::uint64_t runs_count_;
  CampaignTasks tasks_;
};

}  // namespace

bool FlyOnCluster(CampaignStore& store, const ClusterFlying& flying) {
  return ClusterFlights(store, flying).Fly();
}

std::optional<std::string> TasksText(const CampaignStore& store, const fs::path& folder) {
  if (!fs::exists(TasksFolder(folder) / "plan.json")) return {};
  const CampaignTasks tasks = ReadTasks(folder);
  std::size_t left = 0;
  for (const std::uint64_t number : TasksToFly(store.FlownNumbers(), tasks.count, RunsOf(store)))
    left += fs::exists(ResultOf(folder, {number, tasks.count})) ? 0 : 1;
  std::string text = fmt::format("{} of {} tasks were flown", tasks.count - left, tasks.count);
  const std::optional<std::uint64_t> job = LastJob(folder);
  if (left == 0 || !job) return text;
  try {
    const SlurmStates states = StatesOf(*job);
    return text + fmt::format(", {} fly, {} wait (Slurm's job {})", states.flying, states.waiting, *job);
  } catch (const std::runtime_error& error) {
    return text + fmt::format("; Slurm cannot be asked about job {}: {}", *job, error.what());
  }
}

}  // namespace tiltproof::harness
