// Code that a library has executed, compared with the library's own counts.
#include "harness/client/coverage.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "harness/client/library_client.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAreArray;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAreArray;

std::unique_ptr<Client> Load(const std::string& library, bool coverage) {
  return LoadLibraryClient(library, "paper", "paper",
                           {.transmit = [](Uart, BootTime now, std::span<const std::uint8_t>) { return now; },
                            .log = [](BootTime, std::string_view) {}},
                           nullptr, coverage);
}

void RunClient(Client& client, int runs_count) {
  BootTime wake = client.Start(BootTime());
  for (int i = 0; i < runs_count; ++i) wake = client.Grant(wake, BootTime::Never());
}

std::array<unsigned, 18> OwnCounts(const std::string& library) {
  void* handle = dlopen(library.c_str(), RTLD_NOW | RTLD_NOLOAD);
  std::array<unsigned, 18> counts{};
  std::copy_n(static_cast<const unsigned*>(dlsym(handle, "own_counts")), counts.size(), counts.begin());
  dlclose(handle);
  return counts;
}

std::uint32_t SlowBucket(unsigned count) {
  if (count <= 3) return count - 1;
  if (count >= 128) return 7;
  if (count >= 32) return 6;
  std::uint32_t halvings = 0;
  for (; count > 1; count /= 2) ++halvings;
  return halvings + 1;
}

std::vector<std::uint32_t> Buckets(std::span<const std::uint32_t> features) {
  std::vector<std::uint32_t> buckets;
  for (const std::uint32_t feature : features) buckets.push_back(feature % kBucketsCount);
  return buckets;
}
std::vector<std::uint32_t> SlowBuckets(std::span<const unsigned> counts) {
  std::vector<std::uint32_t> buckets;
  for (const unsigned count : counts)
    if (count > 0) buckets.push_back(SlowBucket(count));
  return buckets;
}

class CoverageOf : public ::testing::TestWithParam<std::string> {};

TEST_P(CoverageOf, IsWhatTheLibraryItselfCounts) {
  const auto client = Load(GetParam(), true);
  RunClient(*client, 21);
  const Coverage coverage = client->CodeCoverage();
  EXPECT_EQ(coverage.kind, CoverageKind::kEdges);
  const auto counts = OwnCounts(GetParam());
  EXPECT_EQ(counts[14], 21U);
  EXPECT_EQ(counts[15], 5U);
  // The functions stand in this order; how a compiler orders the blocks of the last is its business.
  ASSERT_THAT(coverage.features, SizeIs(13 + 4));
  const std::span<const std::uint32_t> features = coverage.features;
  EXPECT_THAT(Buckets(features.first(13)), ElementsAreArray(SlowBuckets(std::span(counts).first(14))));
  EXPECT_THAT(Buckets(features.subspan(13)),
              UnorderedElementsAreArray(SlowBuckets(std::span(counts).subspan(14))));
  EXPECT_TRUE(std::ranges::is_sorted(features));
  for (std::size_t i = 1; i < features.size(); ++i)
    EXPECT_LT(features[i - 1] / kBucketsCount, features[i] / kBucketsCount);
}

TEST_P(CoverageOf, BeginsAnewWithEachFlight) {
  auto client = Load(GetParam(), true);
  RunClient(*client, 21);
  const auto whole = client->CodeCoverage().features;
  client = Load(GetParam(), true);
  EXPECT_THAT(client->CodeCoverage().features, IsEmpty());
  RunClient(*client, 21);
  EXPECT_EQ(client->CodeCoverage().kind, CoverageKind::kEdges);
  EXPECT_EQ(client->CodeCoverage().features, whole);
  client = Load(GetParam(), true);
  RunClient(*client, 3);  // never to the left
  EXPECT_THAT(client->CodeCoverage().features, SizeIs(13 + 3));
}

TEST_P(CoverageOf, IsNotTakenUnlessAskedFor) {
  const auto client = Load(GetParam(), false);
  RunClient(*client, 5);
  EXPECT_THAT(client->CodeCoverage().features, IsEmpty());
  EXPECT_EQ(client->CodeCoverage().kind, CoverageKind::kBlackBox);
}

INSTANTIATE_TEST_SUITE_P(Compilers, CoverageOf, ::testing::Values(TILTPROOF_COVERAGE_LIBRARIES),
                         [](const auto& of) {
                           const std::string name = of.param.substr(of.param.rfind("coverage_") + 9);
                           return name.substr(0, name.find('.'));
                         });

TEST(Coverage, OfALibraryThatTellsNothingIsABlackBox) {
  const auto client = Load(TILTPROOF_FIRMWARE_LIBRARY, true);
  RunClient(*client, 5);
  EXPECT_THAT(client->CodeCoverage().features, IsEmpty());
  EXPECT_EQ(client->CodeCoverage().kind, CoverageKind::kBlackBox);
  EXPECT_EQ(Name(client->CodeCoverage().kind), "black box");
}

TEST(Coverage, EveryCountHasItsBucket) {
  for (unsigned count = 1; count < 256; ++count)
    EXPECT_EQ(FeatureOf(7, static_cast<std::uint8_t>(count)), 7 * 8 + SlowBucket(count)) << count;
}

TEST(Coverage, OfCountsThatAreMostlyNoneSkipsNoPlace) {
  for (std::size_t size = 1; size < 40; ++size)
    for (std::size_t at = 0; at < size; ++at) {
      std::vector<std::uint8_t> counts(size, 0);
      counts[at] = 2;
      counts[size - 1] = 1;
      std::vector<std::uint32_t> features, expected;
      AddFeatures(counts, 100, features);
      for (std::size_t i = 0; i < size; ++i)
        if (counts[i] > 0) expected.push_back(FeatureOf(static_cast<std::uint32_t>(100 + i), counts[i]));
      EXPECT_EQ(features, expected);
    }
}

}  // namespace
}  // namespace tiltproof::harness
