#include "harness/campaign/campaign_compare.h"

#include <gmock/gmock.h>

#include <cmath>

#include "harness/campaign/paired_rates.h"
#include "synthetic_runs.h"
#include "tests/harness/report/test_folder.h"

namespace tiltproof::harness {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Mode = CampaignStore::Mode;

// Table II of Newcombe (1998), method 10: the first passes in a + b, the second in a + c, and the difference is first less
// second.
TEST(DifferenceOf, IsThatOfThePublishedTable) {
  const PairedDifference change =
      DifferenceOf({.both = 36, .only_first = 2, .only_second = 12, .neither = 0});
  EXPECT_NEAR(change.difference, 0.2, 1e-12);
  EXPECT_NEAR(change.low, 0.0569, 5e-5);
  EXPECT_NEAR(change.high, 0.3404, 5e-5);
}

double Choose(int n, int k) {
  return std::round(std::exp(std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1)));
}

TEST(DifferenceOf, HasTheExactProbabilityOfMcNemar) {
  for (int b = 0; b <= 12; ++b) {
    for (int c = 0; c <= 12; ++c) {
      // All outcomes that are at least as far from the middle.
      double p = 0.0;
      for (int k = 0; k <= b + c; ++k)
        if (std::abs(2 * k - b - c) >= std::abs(b - c)) p += Choose(b + c, k) * std::pow(0.5, b + c);
      const PairedCounts counts{.both = 3,
                                .only_first = static_cast<std::uint64_t>(b),
                                .only_second = static_cast<std::uint64_t>(c)};
      EXPECT_NEAR(DifferenceOf(counts).p, p, 1e-9) << b << " " << c;
    }
  }
  // Many pairs: near the normal distribution's.
  EXPECT_NEAR(DifferenceOf({.only_first = 500'000, .only_second = 501'000}).p,
              std::erfc(999 / std::sqrt(2.0 * 1'001'000)), 1e-5);
  EXPECT_EQ(DifferenceOf({}).p, 1.0);
}

TEST(DifferenceOf, IsSymmetricAndHoldsTheDifference) {
  for (std::uint64_t i = 0; i < 81; ++i) {
    const PairedCounts counts{
        .both = i % 3 * 4, .only_first = i / 3 % 3 * 2, .only_second = i / 9 % 3 * 5, .neither = i / 27};
    if (counts.count() == 0) continue;
    const PairedCounts swapped{.both = counts.both,
                               .only_first = counts.only_second,
                               .only_second = counts.only_first,
                               .neither = counts.neither};
    const PairedDifference one = DifferenceOf(counts), other = DifferenceOf(swapped);
    EXPECT_LE(one.low, one.difference);
    EXPECT_LE(one.difference, one.high);
    EXPECT_GE(one.low, -1.0);
    EXPECT_LE(one.high, 1.0);
    EXPECT_NEAR(one.low, -other.high, 1e-12);
    EXPECT_NEAR(one.p, other.p, 1e-12);
  }
}

class CompareCampaignsTest : public FolderTest {
 protected:
  void Write(const char* name, const std::vector<CampaignRun>& runs) const {
    std::filesystem::create_directories(folder_ / name);
    CampaignStore(folder_ / name / "campaign.sqlite", Mode::kCreate).Add(runs);
  }
  CampaignComparison Compare() const {
    return CompareCampaigns(CampaignStore(folder_ / "a" / "campaign.sqlite", Mode::kRead),
                            CampaignStore(folder_ / "b" / "campaign.sqlite", Mode::kRead));
  }
};

TEST_F(CompareCampaignsTest, FindsWhatGotBetterAndWorse) {
  std::vector<CampaignRun> a = SyntheticRuns(0, 200), b = a;
  const auto set = [](CampaignRun& run, bool passes, const char* criterion = "c") {
    run.verdict = passes ? "pass" : "fail";
    run.criterion = passes ? "" : criterion;
    run.signature = passes ? "" : std::string(criterion) + ",crashed,x";
  };
  for (std::size_t i = 0; i < a.size(); ++i) {
    set(a[i], i >= 10);
    set(b[i], i < 4 || (i >= 10 && i != 50 && i != 60));
    b[i].firmware = "other";
    for (CampaignFault& fault : b[i].faults) fault.activations += 1;
    if (i < 100) b[i].trace_hash = "ffffffffffffffff";
  }
  set(b[9], false, "d");
  b[70].verdict = "inconclusive";
  b.erase(b.begin() + 80);
  Write("a", a);
  Write("b", b);
  const CampaignComparison comparison = Compare();
  EXPECT_EQ(comparison.runs, 199u);
  EXPECT_EQ(comparison.only_in_first, 1u);
  EXPECT_EQ(comparison.only_in_second, 0u);
  EXPECT_EQ(comparison.identical, 100u);
  EXPECT_EQ(comparison.not_judged, 1u);
  EXPECT_EQ(comparison.better, 4u);
  EXPECT_EQ(comparison.worse, 2u);
  EXPECT_EQ(comparison.other_criterion, 1u);
  EXPECT_EQ(comparison.all.count(), 198u);
  EXPECT_EQ(comparison.all.only_second, 4u);
  EXPECT_NEAR(comparison.all.difference, 2.0 / 198, 1e-12);
  std::vector<std::uint64_t> changed;
  for (const ChangedRun& run : comparison.changed) changed.push_back(run.run);
  EXPECT_THAT(changed, ElementsAre(0, 1, 2, 3, 9, 50, 60));
  EXPECT_THAT(comparison.new_signatures, ElementsAre("d,crashed,x"));
  EXPECT_THAT(comparison.second_firmware, ElementsAre("other"));
  // Each type counts the flights that have it.
  for (const ComparedRates& rates : comparison.by_type) {
    std::uint64_t flights = 0;
    for (const CampaignRun& run : a) {
      if (run.number == 70 || run.number == 80) continue;
      bool has = false;
      for (const CampaignFault& fault : run.faults) has |= fault.type == rates.name;
      flights += has ? 1 : 0;
    }
    EXPECT_EQ(rates.count(), flights) << rates.name;
  }
  EXPECT_THAT(ComparisonTable(comparison),
              AllOf(HasSubstr("B is better in 4, worse in 2"), HasSubstr("50  worse: pass -> c"),
                    HasSubstr("d,crashed,x")));
}

TEST_F(CompareCampaignsTest, RefusesDifferentDraws) {
  std::vector<CampaignRun> runs = SyntheticRuns(0, 20);
  Write("a", runs);
  runs[7].faults[1].severity += 0.001;
  Write("b", runs);
  EXPECT_THAT(ErrorOf([&] { Compare(); }),
              AllOf(HasSubstr("different draws"), HasSubstr("Run 7:"), HasSubstr(runs[7].faults[1].type)));
}

TEST_F(CompareCampaignsTest, RefusesCampaignsWithoutACommonRun) {
  Write("a", SyntheticRuns(0, 10));
  Write("b", SyntheticRuns(10, 20));
  EXPECT_THAT(ErrorOf([&] { Compare(); }), HasSubstr("have no run in common"));
}

}  // namespace
}  // namespace tiltproof::harness
