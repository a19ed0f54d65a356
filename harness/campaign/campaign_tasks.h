// A campaign in tasks, as a cluster flies it: each task flies a part of the runs into a file of its own, and the campaign
// gathers these files. A file is complete or not there. So a task may be killed, flown again, or flown twice at once.
//
//   WriteTasks(folder, {.meta = store.AllMeta(), .count = 20});
//   DeliverTask(scratch / "campaign.sqlite", folder, {.number = 3, .count = 20});  // at the end of task 3
//   const std::size_t gathered = GatherTasks(store, folder);
//
// No machine opens a database that another one writes: SQLite's log needs memory that both have in common.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "harness/campaign/campaign_store.h"
#include "link/fields.h"

namespace tiltproof::harness {

// Part `number` of `count` of the runs, from 1.
struct Shard {
  std::uint64_t number = 1, count = 1;
  // Its runs are [First, First of the next part).
  std::uint64_t First(std::uint64_t runs_count) const;
  std::uint64_t End(std::uint64_t runs_count) const { return Shard{number + 1, count}.First(runs_count); }
};

// All that a task needs to know.
struct CampaignTasks {
  std::map<std::string, std::string> meta;  // of the campaign's store
  std::uint64_t count = 1;                  // tasks; task K flies the runs of Shard{K, count}
  TILTPROOF_FIELDS(meta, count)
};

// tasks/ in the campaign's folder.
std::filesystem::path TasksFolder(const std::filesystem::path& folder);
// tasks/plan.json. Throws FileError.
void WriteTasks(const std::filesystem::path& folder, const CampaignTasks& tasks);
// Throws FileError, or std::runtime_error naming the file.
CampaignTasks ReadTasks(const std::filesystem::path& folder);

// The file of a task that has ended.
std::filesystem::path ResultOf(const std::filesystem::path& folder, const Shard& task);
// Copies a closed database there, at once. Throws FileError.
void DeliverTask(const std::filesystem::path& database, const std::filesystem::path& folder,
                 const Shard& task);
// Takes what tasks have delivered into the store, and removes their files; returns their number. What the store has already
// must be the same. Throws std::runtime_error that names the file.
std::size_t GatherTasks(CampaignStore& store, const std::filesystem::path& folder);

// The tasks with runs that are not flown, by number. `flown`: ascending.
std::vector<std::uint64_t> TasksToFly(const std::vector<std::uint64_t>& flown, std::uint64_t count,
                                      std::uint64_t runs_count);

}  // namespace tiltproof::harness
