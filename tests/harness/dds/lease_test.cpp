#include "harness/dds/lease.h"

#include <gtest/gtest.h>

namespace tiltproof::dds {
namespace {

using std::chrono::milliseconds;

constexpr Lease::Clock::time_point kStart{std::chrono::hours(1)};

TEST(Lease, EndsWhenDdsSaysSo) {
  Lease lease;
  lease.Hear(kStart);
  EXPECT_TRUE(lease.IsKept(kStart + milliseconds(500)));
  lease.Say(false);
  EXPECT_FALSE(lease.IsKept(kStart + milliseconds(200)));
  lease.Say(true);
  EXPECT_TRUE(lease.IsKept(kStart + milliseconds(200)));
}

TEST(Lease, IsKeptByWhoIsHeardWhenDdsSaysNotAliveLast) {
  Lease lease;
  lease.Hear(kStart);
  lease.Say(true);
  lease.Say(false);
  for (milliseconds heard(200); heard < milliseconds(2'000); heard += milliseconds(50)) {
    lease.Hear(kStart + heard);
    EXPECT_TRUE(lease.IsKept(kStart + heard + milliseconds(199))) << heard.count();
  }
  EXPECT_FALSE(lease.IsKept(kStart + milliseconds(2'150)));
}

TEST(Lease, OfWhoWasNeverHeardIsWhatDdsSays) {
  Lease lease;
  EXPECT_TRUE(lease.IsKept(kStart));
  lease.Say(false);
  EXPECT_FALSE(lease.IsKept(kStart));
}

}  // namespace
}  // namespace tiltproof::dds
