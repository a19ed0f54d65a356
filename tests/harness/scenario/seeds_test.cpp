// Seeds from which the clients of a scenario draw their faults.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {
namespace {

Scenario With(const std::vector<std::string>& clients, std::uint64_t seed = 7) {
  Scenario scenario;
  scenario.seed = seed;
  for (const std::string& id : clients) scenario.clients.emplace_back().id = id;
  return scenario;
}

TEST(SeedOfAClient, TheOnlyOneHasTheScenarios) { EXPECT_EQ(With({}).seed_of(0), 7U); }

TEST(SeedOfAClient, NoTwoClientsAndNoTwoSeedsDrawTheSame) {
  EXPECT_NE(With({"a", "b"}).seed_of(0), With({"a", "b"}).seed_of(1));
  EXPECT_NE(With({"a", "b"}, 7).seed_of(0), With({"a", "b"}, 8).seed_of(0));
}

TEST(SeedOfAClient, FollowsItsIdNotItsPlace) {
  EXPECT_EQ(With({"a", "b"}).seed_of(1), With({"b", "c", "a"}).seed_of(0));
}

}  // namespace
}  // namespace tiltproof::harness
