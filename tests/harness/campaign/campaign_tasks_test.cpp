// Tasks of a campaign: which are left, what they deliver, and what a campaign confirms.
#include "harness/campaign/campaign_tasks.h"

#include <gmock/gmock.h>

#include <set>

#include "harness/campaign/campaign_confirm.h"
#include "harness/campaign/campaign_failures.h"
#include "synthetic_runs.h"
#include "tests/harness/report/test_folder.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Mode = CampaignStore::Mode;

TEST(CampaignTasks, ThoseLeftAreThoseThatLackARun) {
  EXPECT_THAT(TasksToFly({}, 3, 10), ElementsAre(1, 2, 3));
  for (std::uint64_t runs_count : {1U, 7U, 10U, 97U}) {
    for (std::uint64_t count : {1U, 3U, 7U}) {
      std::vector<std::uint64_t> all;
      for (std::uint64_t number = 0; number < runs_count; ++number) all.push_back(number);
      EXPECT_THAT(TasksToFly(all, count, runs_count), IsEmpty());
      for (std::uint64_t lost = 0; lost < runs_count; ++lost) {
        std::vector<std::uint64_t> flown = all;
        flown.erase(flown.begin() + static_cast<std::ptrdiff_t>(lost));
        const std::vector<std::uint64_t> left = TasksToFly(flown, count, runs_count);
        ASSERT_EQ(left.size(), 1U);
        const Shard task{left.front(), count};
        EXPECT_LE(task.First(runs_count), lost);
        EXPECT_GT(task.End(runs_count), lost);
      }
    }
  }
}

class TasksTest : public FolderTest {
 protected:
  // The database of a task with these runs.
  std::filesystem::path Scratch(std::span<const CampaignRun> runs, const std::string& seed = "5") const {
    const std::filesystem::path file = folder_ / "scratch.sqlite";
    std::filesystem::remove(file);
    CampaignStore store(file, Mode::kCreate);
    store.SetMeta("seed", seed);
    store.SetMeta("shard", "part");
    store.Add(runs);
    return file;
  }
  std::vector<CampaignRun> RunsOf(const CampaignStore& store) const {
    std::vector<CampaignRun> runs;
    store.ForEach([&](const CampaignRun& run) { runs.push_back(run); });
    return runs;
  }
};

TEST_F(TasksTest, GatheredResultsAreTheCampaignWhateverComesTwice) {
  const std::vector<CampaignRun> runs = SyntheticRuns(0, 60);
  CampaignStore store(folder_ / kStoreFile, Mode::kCreate);
  store.SetMeta("seed", "5");
  WriteTasks(folder_, {.meta = store.AllMeta(), .count = 3});
  EXPECT_EQ(ReadTasks(folder_).count, 3U);
  EXPECT_EQ(ReadTasks(folder_).meta, store.AllMeta());
  const auto deliver = [&](std::uint64_t number) {
    const Shard task{number, 3};
    DeliverTask(Scratch(std::span(runs).subspan(task.First(60), task.End(60) - task.First(60))), folder_,
                task);
  };
  EXPECT_EQ(GatherTasks(store, folder_), 0U);
  deliver(3);
  deliver(1);
  deliver(1);
  EXPECT_EQ(GatherTasks(store, folder_), 2U);
  EXPECT_THAT(TasksToFly(store.FlownNumbers(), 3, 60), ElementsAre(2));
  deliver(2);
  deliver(3);
  EXPECT_EQ(GatherTasks(store, folder_), 2U);
  EXPECT_EQ(RunsOf(store), runs);
  EXPECT_EQ(GatherTasks(store, folder_), 0U);
}

TEST_F(TasksTest, ContradictionsNameTheFile) {
  std::vector<CampaignRun> runs = SyntheticRuns(0, 10);
  CampaignStore store(folder_ / kStoreFile, Mode::kCreate);
  store.SetMeta("seed", "5");
  store.Add(runs);
  WriteTasks(folder_, {.meta = store.AllMeta(), .count = 1});
  const auto why = [&] {
    try {
      GatherTasks(store, folder_);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  runs[4].wall_s += 1;  // of another machine
  DeliverTask(Scratch(runs), folder_, {1, 1});
  EXPECT_EQ(why(), "");
  runs[4].verdict = "another";
  DeliverTask(Scratch(runs), folder_, {1, 1});
  EXPECT_THAT(why(), ::testing::AllOf(HasSubstr("run 4"), HasSubstr("task-1-of-1.sqlite")));
  DeliverTask(Scratch(runs, "6"), folder_, {1, 1});
  EXPECT_THAT(why(), HasSubstr("task-1-of-1.sqlite is not of the same campaign as the others: seed differ"));
}

// The choice by sorting everything.
TEST_F(TasksTest, ConfirmsFirstFailuresAndNearestPasses) {
  CampaignStore store(folder_ / kStoreFile, Mode::kCreate);
  std::vector<CampaignRun> runs = SyntheticRuns(0, 900);
  std::vector<CampaignFailure> failures;
  std::vector<std::pair<double, std::uint64_t>> passes;
  std::map<std::string, std::vector<std::uint64_t>> by_signature;
  for (CampaignRun& run : runs) {
    run.margin = static_cast<double>(run.number * 7919 % 900);
    if (run.signature.empty()) {
      run.verdict = "pass";
      passes.emplace_back(*run.margin, run.number);
    } else {
      run.verdict = "fail";
      failures.push_back({.run = run.number, .signature = run.signature});
      by_signature[run.signature].push_back(run.number);
    }
  }
  store.Add(runs);
  store.PutFailures(failures);
  ASSERT_GT(passes.size(), kConfirmedPasses);
  ASSERT_LT(by_signature.size(), kKeptMax);
  std::set<std::uint64_t> expected;
  for (const auto& [signature, numbers] : by_signature)
    expected.insert(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(
                                                           std::min(numbers.size(), kConfirmedPerSignature)));
  std::sort(passes.begin(), passes.end());
  for (std::size_t i = 0; i < kConfirmedPasses; ++i) expected.insert(passes[i].second);
  EXPECT_THAT(RunsToConfirm(store), ::testing::ElementsAreArray(expected));

  // One flight is the same, one is not, and one was not to be flown.
  const std::uint64_t failed = failures.front().run, passed = passes.front().second;
  const CampaignRun& first = runs[failed];
  const std::vector<CampaignConfirmation> found = {{.run = failed,
                                                    .client = "qemu:a.elf",
                                                    .verdict = "fail",
                                                    .end = first.end,
                                                    .criterion = first.criterion,
                                                    .time_s = 3.5,
                                                    .margin = -1,
                                                    .trace_hash = "0123456789abcdef"},
                                                   {.run = passed,
                                                    .client = "qemu:a.elf",
                                                    .verdict = "fail",
                                                    .end = "completed",
                                                    .criterion = "near",
                                                    .time_s = 1,
                                                    .margin = -0.5,
                                                    .trace_hash = "0123456789abcdef"},
                                                   {.run = passes.back().second,
                                                    .client = "qemu:a.elf",
                                                    .verdict = "pass",
                                                    .end = "completed",
                                                    .criterion = "",
                                                    .time_s = {},
                                                    .margin = 1,
                                                    .trace_hash = ""}};
  store.PutConfirmations(found);
  store.PutConfirmations(found);
  EXPECT_EQ(store.Confirmations().size(), 3U);
  const std::vector<CampaignConfirmed> confirmed = ConfirmedOf(store);
  ASSERT_EQ(confirmed.size(), 1U);
  EXPECT_EQ(confirmed[0].client, "qemu:a.elf");
  EXPECT_EQ(confirmed[0].flights, 2U);
  EXPECT_EQ(confirmed[0].same, 1U);
  EXPECT_EQ(confirmed[0].differ, 1U);
  const std::vector<std::string> lines = DifferenceLines(confirmed[0]);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_THAT(lines[0], HasSubstr("-> fail near at 1.000 s, margin -0.5"));
}

}  // namespace
}  // namespace tiltproof::harness
