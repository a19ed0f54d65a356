#include "harness/campaign/campaign_store.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <limits>
#include <set>

#include "harness/report/files.h"
#include "synthetic_runs.h"
#include "tests/harness/report/test_folder.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Mode = CampaignStore::Mode;

// Python's own sqlite3 reads the file: output of a program that has the file's name as `file`.
std::string Python(const std::filesystem::path& file, const std::string& program) {
  const std::string command =
      "python3 -c \"import sqlite3; db = sqlite3.connect('" + file.string() + "'); " + program + "\" 2>&1";
  std::FILE* pipe = popen(command.c_str(), "r");
  std::string text;
  for (int c; (c = std::fgetc(pipe)) != EOF;) text += static_cast<char>(c);
  pclose(pipe);
  return text;
}

class CampaignStoreTest : public FolderTest {
 protected:
  std::filesystem::path file() const { return folder_ / "campaign.sqlite"; }
  std::vector<CampaignRun> All() const {
    std::vector<CampaignRun> runs;
    CampaignStore(file(), Mode::kRead).ForEach([&](const CampaignRun& run) { runs.push_back(run); });
    return runs;
  }
};

TEST_F(CampaignStoreTest, GivesBackWhatItGotInTheOrderOfNumbers) {
  std::vector<CampaignRun> runs = SyntheticRuns(0, 50);
  runs[3].seed = std::numeric_limits<std::uint64_t>::max();
  runs[4].margin = std::numeric_limits<double>::infinity();
  runs[5].trace_hash = "0xABC";
  runs[6].trace_hash = "";
  runs[7].faults.clear();
  runs[8].criteria.clear();
  runs[9].faults[1].place = "a text\nwith 'quotes', \"more\" and \xc3\xa9";
  runs[10].criteria[0].margin = {};
  {
    CampaignStore store(file(), Mode::kCreate);
    store.Add(std::span(runs).subspan(30));
    store.Add(std::span(runs).first(30));
    EXPECT_TRUE(store.Has(49));
    EXPECT_FALSE(store.Has(50));
  }
  EXPECT_EQ(All(), runs);
  const CampaignStore store(file(), Mode::kRead);
  EXPECT_EQ(store.Find(9), runs[9]);
  EXPECT_EQ(store.Find(50), std::nullopt);
  EXPECT_EQ(store.FlownNumbers().size(), 50u);
}

TEST_F(CampaignStoreTest, HoldsMetaAndFailures) {
  {
    CampaignStore store(file(), Mode::kCreate);
    store.SetMeta("seed", "7");
    store.SetMeta("seed", "8");
    store.PutFailures(std::vector<CampaignFailure>{{.run = 5, .signature = "b"},
                                                   {.run = 2, .signature = "a", .minimal = "failures/a/s"}});
    store.PutFailures(std::vector<CampaignFailure>{{.run = 5, .signature = "a"}});
  }
  const CampaignStore store(file(), Mode::kOpen);
  EXPECT_EQ(store.Meta("seed"), "8");
  EXPECT_EQ(store.Meta("other"), std::nullopt);
  EXPECT_EQ(store.AllMeta(), (std::map<std::string, std::string>{{"seed", "8"}}));
  EXPECT_THAT(store.Failures(),
              ElementsAre(CampaignFailure{.run = 2, .signature = "a", .minimal = "failures/a/s"},
                          CampaignFailure{.run = 5, .signature = "a"}));
}

TEST_F(CampaignStoreTest, HasTheDocumentedTablesForOtherPrograms) {
  const CampaignRun run = [] {
    CampaignRun one = SyntheticRun(12);
    one.seed = 77;
    one.firmware = "paper";
    one.verdict = "fail";
    one.end = "crashed";
    one.criterion = "upright";
    one.time_s = 1.5;
    one.margin = -0.25;
    one.trace_hash = "00ff00ff00ff00ff";
    one.wall_s = 0.125;
    one.faults = {{"loss", "wire.drop", "to_plant", 0.5, 1.0, 2.0, 3}};
    one.criteria = {{"upright", "fail", -0.25}};
    return one;
  }();
  CampaignStore store(file(), Mode::kCreate);
  store.Add({&run, 1});
  store.PutFailures(std::vector<CampaignFailure>{{.run = 12, .signature = "s", .minimal = "m"}});
  // While the writer is there.
  EXPECT_EQ(
      Python(file(),
             "print(*db.execute('select number, seed, firmware, verdict, end, criterion, time_s, margin, "
             "trace_hash, wall_s from run'))"),
      "(12, 77, 'paper', 'fail', 'crashed', 'upright', 1.5, -0.25, '00ff00ff00ff00ff', 0.125)\n");
  EXPECT_EQ(Python(file(),
                   "print(*db.execute('select run, id, type, place, severity, start_s, end_s, activations "
                   "from fault'))"),
            "(12, 'loss', 'wire.drop', 'to_plant', 0.5, 1.0, 2.0, 3)\n");
  EXPECT_EQ(Python(file(), "print(*db.execute('select run, name, verdict, margin from criterion'))"),
            "(12, 'upright', 'fail', -0.25)\n");
  EXPECT_EQ(Python(file(), "print(*db.execute('select signature, run, minimal from failure'))"),
            "('s', 12, 'm')\n");
}

TEST_F(CampaignStoreTest, AgreesWithPythonOnManyRuns) {
  const std::vector<CampaignRun> runs = SyntheticRuns(0, 10'000);
  CampaignStore(file(), Mode::kCreate).Add(runs);
  std::size_t failed = 0;
  std::int64_t activations = 0;
  for (const CampaignRun& run : runs) {
    failed += run.verdict == "fail" ? 1 : 0;
    for (const CampaignFault& fault : run.faults) activations += fault.activations;
  }
  EXPECT_EQ(Python(file(),
                   "print(*[db.execute('select ' + q).fetchone()[0] for q in (\\\"count(*) from run where "
                   "verdict = 'fail'\\\", 'sum(activations) from fault', 'count(*) from criterion')])"),
            fmt::format("{} {} {}\n", failed, activations, 5 * runs.size()));
  // With three faults and five criteria; about 390.
  EXPECT_LE(std::filesystem::file_size(file()), 500 * runs.size());
}

TEST_F(CampaignStoreTest, ANumberThatIsThereAddsNothing) {
  CampaignStore store(file(), Mode::kCreate);
  store.Add(SyntheticRuns(0, 3));
  // Texts of a transaction that failed are not there either.
  std::vector<CampaignRun> more = SyntheticRuns(3, 5);
  more[0].scenario = "another";
  more.push_back(SyntheticRun(1));
  EXPECT_THAT(ErrorOf([&] { store.Add(more); }), HasSubstr("campaign.sqlite: run 1 is there already"));
  EXPECT_EQ(store.FlownNumbers().size(), 3u);
  more.pop_back();
  store.Add(more);
  EXPECT_EQ(store.Find(3), more[0]);
}

TEST_F(CampaignStoreTest, RefusesASecondWriterAndLetsReadersIn) {
  {
    CampaignStore store(file(), Mode::kCreate);
    store.Add(SyntheticRuns(0, 3));
    EXPECT_THAT(ErrorOf([&] { CampaignStore(file(), Mode::kOpen); }),
                HasSubstr("campaign.sqlite: another program writes to this campaign"));
    EXPECT_EQ(All().size(), 3u);
    store.Add(SyntheticRuns(3, 4));
    EXPECT_EQ(All().size(), 4u);
  }
  CampaignStore(file(), Mode::kOpen).Add(SyntheticRuns(4, 5));
  EXPECT_EQ(All().size(), 5u);
}

TEST_F(CampaignStoreTest, RefusesWhatIsNoCampaignOfThisVersion) {
  EXPECT_THAT(ErrorOf([&] { CampaignStore(file(), Mode::kOpen); }), HasSubstr("there is no such file"));
  EXPECT_THAT(ErrorOf([&] { CampaignStore(file(), Mode::kRead); }), HasSubstr("there is no such file"));
  EXPECT_THAT(ErrorOf([&] { CampaignStore(folder_ / "no" / "file", Mode::kCreate); }),
              HasSubstr("No such file or directory"));
  { CampaignStore created(file(), Mode::kCreate); }
  EXPECT_THAT(ErrorOf([&] { CampaignStore(file(), Mode::kCreate); }),
              HasSubstr("there is a campaign already"));
  Python(file(), "db.execute('pragma user_version = 2')");
  for (const Mode mode : {Mode::kOpen, Mode::kRead})
    EXPECT_THAT(ErrorOf([&] { CampaignStore(file(), mode); }),
                HasSubstr("written by a newer tiltproof (format 2; this one reads formats up to 1)"));
  Python(folder_ / "other.sqlite", "db.execute('create table a(b)')");
  std::ofstream(folder_ / "text.sqlite") << std::string(5000, 'x');
  for (const char* name : {"other.sqlite", "text.sqlite"})
    for (const Mode mode : {Mode::kOpen, Mode::kRead, Mode::kCreate})
      EXPECT_THAT(ErrorOf([&] { CampaignStore(folder_ / name, mode); }), HasSubstr("is no campaign"));
}

// Writes batches of 20 runs until it is killed; prints the number of committed ones into the pipe.
[[noreturn]] void WriteForever(const std::filesystem::path& file, int pipe, std::uint64_t first) {
  CampaignStore store(file, Mode::kOpen);
  for (std::uint64_t number = first;; number += 20) {
    store.Add(SyntheticRuns(number, number + 20));
    const std::uint64_t committed = number + 20;
    if (write(pipe, &committed, sizeof committed) < 0) _exit(1);
  }
}

TEST_F(CampaignStoreTest, LosesNothingAndDoublesNothingWhenItIsKilled) {
  { CampaignStore created(file(), Mode::kCreate); }
  std::uint64_t flown = 0;
  for (std::uint64_t kill_after = 1; kill_after <= 20; ++kill_after) {
    std::array<int, 2> ends;
    ASSERT_EQ(pipe(ends.data()), 0);
    const pid_t writer = fork();
    if (writer == 0) WriteForever(file(), ends[1], flown);
    close(ends[1]);
    std::uint64_t committed = 0;
    for (std::uint64_t i = 0; i < kill_after; ++i) ASSERT_GT(read(ends[0], &committed, sizeof committed), 0);
    // In the middle of whatever it does.
    EXPECT_FALSE(SyntheticRuns(0, 11 * kill_after).empty());
    kill(writer, SIGKILL);
    waitpid(writer, nullptr, 0);
    for (std::uint64_t more; read(ends[0], &more, sizeof more) > 0;) committed = more;
    close(ends[0]);
    flown = CampaignStore(file(), Mode::kOpen).FlownNumbers().size();
    ASSERT_GE(flown, committed);
    ASSERT_LE(flown, committed + 20);
  }
  EXPECT_EQ(flown % 20, 0u);
  EXPECT_EQ(All(), SyntheticRuns(0, flown));
  EXPECT_EQ(Python(file(), "print(db.execute('pragma integrity_check').fetchone()[0])"), "ok\n");
}

TEST_F(CampaignStoreTest, ReportsADiskThatRefusesAndGoesOn) {
  signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const rlim_t before = limit.rlim_cur;
  CampaignStore store(file(), Mode::kCreate);
  store.Add(SyntheticRuns(0, 100));
  limit.rlim_cur = 300'000;
  setrlimit(RLIMIT_FSIZE, &limit);
  EXPECT_THROW(store.Add(SyntheticRuns(100, 5000)), FileError);
  EXPECT_THAT(ErrorOf([&] { store.Add(SyntheticRuns(100, 5000)); }), HasSubstr("File too large"));
  limit.rlim_cur = before;
  setrlimit(RLIMIT_FSIZE, &limit);
  EXPECT_EQ(store.FlownNumbers().size(), 100u);
  store.Add(SyntheticRuns(100, 5000));
  EXPECT_EQ(All(), SyntheticRuns(0, 5000));
}

TEST_F(CampaignStoreTest, ReadsFromAFolderThatIsNotWritable) {
  CampaignStore(file(), Mode::kCreate).Add(SyntheticRuns(0, 10));
  if (geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  std::filesystem::permissions(folder_,
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  EXPECT_EQ(All().size(), 10u);
  std::filesystem::permissions(folder_, std::filesystem::perms::owner_all);
}

}  // namespace
}  // namespace tiltproof::harness
