// Slurm, by its commands sbatch and squeue (version 20.02 or later): job arrays are submitted and watched.
//
//   const std::uint64_t job = SubmitArray({.script = "tasks/task.sh", .numbers = {1, 2, 3}, .name = "night"});
//   while (StatesOf(job).any()) Wait();
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tiltproof::harness {

struct SlurmArray {
  std::filesystem::path script;        // gets its number as SLURM_ARRAY_TASK_ID
  std::vector<std::uint64_t> numbers;  // ascending, below Slurm's MaxArraySize
  std::string name;                    // of the job
  std::filesystem::path log;           // what the tasks print; %a is the number of each
  int processors = 1;                  // of each task
};
// The job's number. A task whose node dies is queued again. Throws UsageError without Slurm's commands, and
// std::runtime_error with Slurm's reason when it refuses the job.
std::uint64_t SubmitArray(const SlurmArray& array);

// Tasks of a job array by their state. Those that have ended are not counted.
struct SlurmStates {
  std::size_t flying = 0, waiting = 0;
  bool any() const { return flying + waiting > 0; }
};
// Throws as above, when Slurm cannot be asked.
SlurmStates StatesOf(std::uint64_t job);

// "1-4,7": the numbers as Slurm reads them.
std::string RangesText(const std::vector<std::uint64_t>& numbers);

}  // namespace tiltproof::harness
