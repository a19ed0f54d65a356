#include "harness/campaign/campaign_summary.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <set>

#include "harness/campaign/campaign_failures.h"
#include "harness/campaign/campaign_signature.h"
#include "harness/report/files.h"
#include "synthetic_runs.h"
#include "tests/harness/report/test_folder.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Mode = CampaignStore::Mode;
namespace fs = std::filesystem;

// The frame of synthetic runs: rising, falling and no severities.
CampaignFrame SyntheticFrame(std::uint64_t runs_count) {
  CampaignFrame frame{.campaign = "synthetic", .seed = 7, .runs_count = runs_count};
  frame.durations_s["spiral"] = 40.0;  // faults start in the first 30 s
  for (int type = 0; type < 41; ++type) {
    for (int place = 0; place < 7; ++place) {
      CampaignRange range{fmt::format("layer.type_{}", type),
                          place == 6 ? "" : fmt::format("place_{}", place),
                          "level",
                          "m",
                          {}};
      if (type % 3 == 0) range.levels = {0.0, 0.25, 0.5, 0.75, 1.0};
      if (type % 3 == 1) range.levels = {1.0, 0.3, 0.1, 0.03, 0.0};
      frame.ranges.push_back(range);
    }
  }
  return frame;
}

// Some runs that were not judged, and faults that never acted.
std::vector<CampaignRun> VariedRuns(std::uint64_t from, std::uint64_t to) {
  std::vector<CampaignRun> runs = SyntheticRuns(from, to);
  for (CampaignRun& run : runs) {
    if (run.number % 17 == 3) run.verdict = "inconclusive", run.signature = "";
    if (run.number % 31 == 5) run.verdict = "error", run.signature = "";
    if (run.number % 3 == 0) run.faults[0].activations = 0;
    if (run.number % 5 == 0) run.faults.pop_back();
    if (!run.signature.empty()) run.signature = FirstSignature(run);
  }
  return runs;
}

// A campaign with the numbers that `takes` in `folder`; of every failure the types of even length suffice.
void MakeCampaign(const fs::path& folder, std::uint64_t runs_count,
                  const std::function<bool(std::uint64_t)>& takes, const std::string& shard) {
  fs::create_directories(folder);
  CampaignStore store(folder / kStoreFile, Mode::kCreate);
  store.SetMeta(kFrameKey, ToJsonText(SyntheticFrame(runs_count)));
  store.SetMeta("shard", shard);
  std::vector<CampaignRun> runs = VariedRuns(0, runs_count);
  std::erase_if(runs, [&](const CampaignRun& run) { return !takes(run.number); });
  store.Add(runs);
  MinimiseFailures(store, folder, [&](std::uint64_t run) {
    MinimalForm minimal;
    for (const std::string& type : TypesOf(store.Find(run)->signature))
      if (type.size() % 2 == 0) minimal.types.push_back(type);
    minimal.scenario = fmt::format("# {}\n", run);
    return minimal;
  });
  WriteSummary(store, folder);
}

int Oracle(const fs::path& folder) {
  return std::system(
      ("python3 -B " TILTPROOF_SOURCE_DIR "/tests/harness/campaign/campaign_oracle.py " + folder.string())
          .c_str());
}

class CampaignSummaryTest : public FolderTest {};

TEST_F(CampaignSummaryTest, AgreesWithAnOracleThatReadsTheDatabase) {
  MakeCampaign(
      folder_, 2000, [](std::uint64_t) { return true; }, "");
  EXPECT_EQ(Oracle(folder_), 0);
  const CampaignSummary summary = ReadCampaignSummary(folder_ / "campaign.json");
  EXPECT_TRUE(summary.complete);
  EXPECT_GT(summary.signatures, 10u);
  EXPECT_GT(summary.inconclusive, 0u);
  EXPECT_GT(summary.errors, 0u);
  // The type that no run has.
  EXPECT_EQ(summary.by_type.back().type, "layer.type_40");
  EXPECT_EQ(summary.by_type.back().rate, std::nullopt);
}

TEST_F(CampaignSummaryTest, OfACampaignWithoutRunsSaysNothing) {
  MakeCampaign(
      folder_, 100, [](std::uint64_t) { return false; }, "");
  const CampaignSummary summary = ReadCampaignSummary(folder_ / "campaign.json");
  EXPECT_EQ(summary.rate, std::nullopt);
  EXPECT_FALSE(summary.complete);
  EXPECT_THAT(summary.curve, IsEmpty());
}

TEST_F(CampaignSummaryTest, OfMergedShardsIsThatOfTheWholeCampaign) {
  constexpr std::uint64_t kRuns = 1500;
  MakeCampaign(
      folder_ / "whole", kRuns, [](std::uint64_t) { return true; }, "");
  std::vector<fs::path> shards;
  for (std::uint64_t k = 0; k < 3; ++k) {
    shards.push_back(folder_ / fmt::format("shard_{}", k));
    // Runs 0 to 99 are in all of them.
    MakeCampaign(
        shards.back(), kRuns, [k](std::uint64_t run) { return run < 100 || run % 3 == k; },
        fmt::format("{}/3", k + 1));
  }
  const std::map<std::string, std::string> of_shard = {{"shard", "1/1"}};
  MergeCampaigns(std::vector{shards[2], shards[0], shards[1]}, folder_ / "merged", of_shard);
  EXPECT_EQ(ReadFile(folder_ / "merged" / "campaign.json"), ReadFile(folder_ / "whole" / "campaign.json"));
  const CampaignStore merged(folder_ / "merged" / kStoreFile, Mode::kRead),
      whole(folder_ / "whole" / kStoreFile, Mode::kRead);
  merged.ForEachBeside(whole, [](const CampaignRun* a, const CampaignRun* b) {
    ASSERT_TRUE(a != nullptr && b != nullptr);
    ASSERT_EQ(*a, *b);
  });
  EXPECT_EQ(merged.Failures(), whole.Failures());
  EXPECT_EQ(merged.Meta("shard"), "1/1");
  // The smallest scenarios came along.
  std::set<std::string> files[2];
  for (int i = 0; i < 2; ++i) {
    const fs::path failures = folder_ / (i == 0 ? "merged" : "whole") / "failures";
    for (const auto& entry : fs::recursive_directory_iterator(failures))
      if (entry.is_regular_file())
        files[i].insert(fs::relative(entry.path(), failures).string() + " " + ReadFile(entry.path()));
  }
  EXPECT_GT(files[0].size(), 20u);
  EXPECT_EQ(files[0], files[1]);
  EXPECT_THAT(ErrorOf([&] { MergeCampaigns(shards, folder_ / "merged", of_shard); }),
              HasSubstr("there is a campaign already"));
}

TEST_F(CampaignSummaryTest, ShardsThatContradictEachOtherAreNotMerged) {
  MakeCampaign(
      folder_ / "a", 30, [](std::uint64_t run) { return run < 20; }, "");
  MakeCampaign(
      folder_ / "b", 30, [](std::uint64_t run) { return run > 20; }, "");
  {
    CampaignStore store(folder_ / "b" / kStoreFile, Mode::kOpen);
    std::vector<CampaignRun> runs = VariedRuns(11, 12);
    runs[0].trace_hash = "0123456789abcdef";
    store.Add(runs);
  }
  const std::vector<fs::path> shards = {folder_ / "a", folder_ / "b"};
  EXPECT_THAT(ErrorOf([&] { MergeCampaigns(shards, folder_ / "merged", {}); }),
              ::testing::AllOf(HasSubstr("run 11"), HasSubstr("contradicts"), HasSubstr("0123456789abcdef")));
  EXPECT_FALSE(fs::exists(folder_ / "merged" / kStoreFile));
  EXPECT_TRUE(fs::is_empty(folder_ / "merged"));
  MakeCampaign(
      folder_ / "other", 31, [](std::uint64_t run) { return run > 20; }, "");
  EXPECT_THAT(ErrorOf([&] {
                MergeCampaigns(std::vector{folder_ / "a", folder_ / "other"}, folder_ / "m", {});
              }),
              ::testing::AllOf(HasSubstr("is not of the same campaign as the others"), HasSubstr("frame")));
}

TEST_F(CampaignSummaryTest, MinimisingGoesOnWhereItStopped) {
  const auto is_failure = [](const CampaignRun& run) { return !run.signature.empty(); };
  CampaignStore store(folder_ / kStoreFile, Mode::kCreate);
  store.SetMeta(kFrameKey, ToJsonText(SyntheticFrame(60)));
  std::vector<CampaignRun> runs = VariedRuns(0, 60);
  // All failures have one signature.
  std::vector<std::uint64_t> failing;
  for (CampaignRun& run : runs)
    if (is_failure(run))
      run.signature = "one", run.criterion = "c", run.end = "e", failing.push_back(run.number);
  ASSERT_GT(failing.size(), 5u);
  store.Add(runs);
  std::vector<std::uint64_t> asked;
  const auto minimise = [&](std::uint64_t run) -> std::optional<MinimalForm> {
    asked.push_back(run);
    if (asked.size() == 2) return std::nullopt;  // interrupted
    return MinimalForm{{"wire.drop"}, "text"};
  };
  MinimiseFailures(store, folder_, minimise);
  MinimiseFailures(store, folder_, minimise);
  EXPECT_THAT(asked, ElementsAre(failing[0], failing[1], failing[2], failing[1]));
  MinimiseFailures(store, folder_, minimise);
  EXPECT_EQ(asked.size(), 4u);
  for (const CampaignFailure& failure : store.Failures()) EXPECT_EQ(failure.signature, "c,e,wire.drop");
  EXPECT_EQ(store.Failures().size(), failing.size());
  EXPECT_EQ(ReadFile(folder_ / "failures" / "c,e,wire.drop" / "scenario.yaml"), "text");
}

TEST(BandOf, FollowsTheSideOfTheLevel) {
  CampaignFrame frame;
  frame.ranges = {{"a", "x", "p", "", {0, 1, 2, 3, 4}},
                  {"a", "x", "p", "", {0, -1, -2, -3, -4}},
                  {"a", "y", "p", "", {100, 50, 20, 10, 5}},
                  {"b", "", "", "", {}}};
  const auto band = [&](const char* type, const char* place, double level) {
    return BandOf(frame, {.id = "", .type = type, .place = place, .severity = level});
  };
  EXPECT_EQ(band("a", "x", 0.5), 0u);
  EXPECT_EQ(band("a", "x", 3.5), 3u);
  EXPECT_EQ(band("a", "x", 99.0), 3u);
  EXPECT_EQ(band("a", "x", -0.5), 0u);
  EXPECT_EQ(band("a", "x", -2.5), 2u);
  EXPECT_EQ(band("a", "y", 200.0), 0u);
  EXPECT_EQ(band("a", "y", 15.0), 2u);
  EXPECT_EQ(band("a", "y", 1.0), 3u);
  EXPECT_EQ(band("b", "", 7.0), 0u);
  EXPECT_EQ(band("c", "", 7.0), std::nullopt);
}

CampaignRun FailedAt(std::optional<double> time_s, std::vector<CampaignFault> faults) {
  CampaignRun run;
  run.verdict = "fail";
  run.criterion = "upright";
  run.end = "diverged";
  run.time_s = time_s;
  run.faults = std::move(faults);
  return run;
}

TEST(FirstSignature, HasTheTypesThatAreActiveAtTheViolation) {
  const std::vector<CampaignFault> faults = {{"1", "wire.drop", "", 0, 1, 5, 3},
                                             {"2", "clock.drift", "", 0, 4, 9, 3},
                                             {"3", "clock.drift", "x", 0, 4, 9, 3},
                                             {"4", "plant.wind", "", 0, 0, 9, 0},
                                             {"5", "sensor.bias", "", 0, 6, 9, 1}};
  EXPECT_EQ(FirstSignature(FailedAt(4.5, faults)), "upright,diverged,clock.drift+wire.drop");
  EXPECT_EQ(FirstSignature(FailedAt(5.5, faults)), "upright,diverged,clock.drift");
  // Long after: all that acted before.
  EXPECT_EQ(FirstSignature(FailedAt(20.0, faults)), "upright,diverged,clock.drift+sensor.bias+wire.drop");
  EXPECT_EQ(FirstSignature(FailedAt({}, faults)), "upright,diverged,clock.drift+sensor.bias+wire.drop");
  EXPECT_EQ(FirstSignature(FailedAt(0.5, faults)), "upright,diverged,no_fault");
  CampaignRun passed = FailedAt(4.5, faults);
  passed.verdict = "pass";
  EXPECT_EQ(FirstSignature(passed), "");
}

TEST(SignatureText, IsTheNameOfAFolderAndReadsBack) {
  EXPECT_THAT(TypesOf("c,e,a.b+c.d"), ElementsAre("a.b", "c.d"));
  EXPECT_THAT(TypesOf(SignatureText("c", "e", {})), IsEmpty());
  const std::string odd = SignatureText("../a b/\n", "e", {"x"});
  EXPECT_EQ(odd.find('/'), std::string::npos);
  EXPECT_NE(odd.front(), '.');
  EXPECT_NE(odd, SignatureText("../a b/\t", "e", {"x"}));
  EXPECT_LT(SignatureText(std::string(5000, 'c'), "e", std::vector<std::string>(50, "t")).size(), 200u);
  std::vector<std::string> many;
  for (int i = 0; i < 40; ++i) many.push_back(fmt::format("layer.a_long_name_{}", i));
  const std::string text = SignatureText("c", "e", many);
  EXPECT_LT(text.size(), 60u);
  many.back() += "x";
  EXPECT_NE(text, SignatureText("c", "e", many));
}

TEST(FinalFailures, FollowTheMinimisedFlightsOfTheirFirstSignature) {
  const auto minimal = [](std::uint64_t run, const char* signature) {
    return CampaignFailure{.run = run, .signature = signature, .minimal = "file"};
  };
  const std::vector<FirstFailure> failures = {
      {1, "a", minimal(1, "x")},
      {2, "b", minimal(2, "y")},
      {3, "a", minimal(3, "z")},
      {4, "a", minimal(4, "z")},
      {5, "a", {}},
      {6, "c", {}},
      {7, "b", {}},
  };
  std::vector<std::string> signatures;
  for (const CampaignFailure& failure : FinalFailures(failures)) signatures.push_back(failure.signature);
  EXPECT_THAT(signatures, ElementsAre("x", "y", "z", "z", "z", "c", "y"));
}

}  // namespace
}  // namespace tiltproof::harness
