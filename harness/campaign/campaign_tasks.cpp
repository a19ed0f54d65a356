#include "harness/campaign/campaign_tasks.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <stdexcept>

#include "harness/campaign/campaign_failures.h"
#include "harness/report/files.h"
#include "harness/report/json_fields.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

constexpr const char* kResultEnd = ".sqlite";
// The part of the runs that a store holds.
constexpr const char* kPartKey = "shard";

std::string HostName() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return name.data();
}

}  // namespace

std::uint64_t Shard::First(std::uint64_t runs_count) const {
  // Without the product of the two, which may be too large.
  const std::uint64_t before = number - 1;
  return runs_count / count * before + runs_count % count * before / count;
}

fs::path TasksFolder(const fs::path& folder) { return folder / "tasks"; }

void WriteTasks(const fs::path& folder, const CampaignTasks& tasks) {
  std::error_code error;
  fs::create_directories(TasksFolder(folder), error);
  if (error) throw FileError(fmt::format("{}: {}", TasksFolder(folder).string(), error.message()));
  WriteFile(TasksFolder(folder) / "plan.json", JsonText(ToJson(tasks), 1) + "\n");
}

CampaignTasks ReadTasks(const fs::path& folder) {
  const fs::path file = TasksFolder(folder) / "plan.json";
  const std::string text = ReadFile(file);
  try {
    CampaignTasks tasks = FromJson<CampaignTasks>(Json::parse(text));
    if (tasks.count == 0) throw std::runtime_error("it has no tasks");
    return tasks;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

fs::path ResultOf(const fs::path& folder, const Shard& task) {
  return TasksFolder(folder) / fmt::format("task-{}-of-{}{}", task.number, task.count, kResultEnd);
}

void DeliverTask(const fs::path& database, const fs::path& folder, const Shard& task) {
  const fs::path result = ResultOf(folder, task);
  // A name that no other process has, on any machine: the same task may be flown twice at once.
  const fs::path own = fmt::format("{}.{}.{}", result.string(), HostName(), getpid());
  std::ifstream from(database, std::ios::binary);
  NewFile copy(own);
  std::string part(1 << 20, '\0');
  while (from.read(part.data(), static_cast<std::streamsize>(part.size())) || from.gcount() > 0)
    copy.Write(std::string_view(part).substr(0, static_cast<std::size_t>(from.gcount())));
  if (!from.eof()) throw FileError(fmt::format("cannot read {}", database.string()));
  copy.Finish();
  std::error_code error;
  fs::rename(own, result, error);
  if (error) throw FileError(fmt::format("{}: {}", result.string(), error.message()));
}

std::size_t GatherTasks(CampaignStore& store, const fs::path& folder) {
  std::vector<fs::path> results;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(TasksFolder(folder), error))
    if (entry.path().extension() == kResultEnd) results.push_back(entry.path());
  std::sort(results.begin(), results.end());
  for (const fs::path& result : results) {
    AddRunsOf(CampaignStore(result, CampaignStore::Mode::kRead), result.string(), {kPartKey}, store);
    fs::remove(result, error);
    if (error) throw FileError(fmt::format("{}: {}", result.string(), error.message()));
    // Files that the reader leaves behind.
    for (const char* end : {"-wal", "-shm"}) fs::remove(result.string() + end, error);
  }
  return results.size();
}

std::vector<std::uint64_t> TasksToFly(const std::vector<std::uint64_t>& flown, std::uint64_t count,
                                      std::uint64_t runs_count) {
  std::vector<std::uint64_t> tasks;
  for (std::uint64_t number = 1; number <= count; ++number) {
    const Shard task{number, count};
    const std::uint64_t first = task.First(runs_count), end = task.End(runs_count);
    const auto from = std::lower_bound(flown.begin(), flown.end(), first);
    const auto to = std::lower_bound(from, flown.end(), end);
    if (static_cast<std::uint64_t>(to - from) < end - first) tasks.push_back(number);
  }
  return tasks;
}

}  // namespace tiltproof::harness
