// Runs of a campaign that was never flown: three faults and five criteria each, everything drawn.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "harness/campaign/campaign_store.h"

namespace tiltproof::harness {

inline CampaignRun SyntheticRun(std::uint64_t number) {
  std::mt19937_64 random(number);
  const auto below = [&](std::uint64_t end) { return random() % end; };
  const auto real = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  CampaignRun run;
  run.number = number;
  run.seed = random();
  run.scenario = "spiral";
  run.firmware = below(2) == 0 ? "paper" : "tolerant";
  const bool failed = below(4) == 0;
  run.verdict = failed ? "fail" : "pass";
  run.end = failed ? "crashed" : "duration";
  if (failed) {
    run.criterion = fmt::format("criterion_{}", below(5));
    run.time_s = 60 * real();
    run.signature = fmt::format("{}.crashed.wire.drop", run.criterion);
  }
  run.margin = real() - 0.25;
  run.trace_hash = fmt::format("{:016x}", random());
  run.wall_s = 0.05 * real();
  for (int i = 0; i < 3; ++i) {
    const double start_s = 30 * real();
    run.faults.push_back({fmt::format("fault_{}", i + 1), fmt::format("layer.type_{}", below(40)),
                          below(3) == 0 ? "" : fmt::format("place_{}", below(6)), real(), start_s,
                          start_s + 20 * real(), static_cast<std::int64_t>(below(5000))});
  }
  for (int i = 0; i < 5; ++i)
    run.criteria.push_back({fmt::format("criterion_{}", i), below(9) == 0 ? "fail" : "pass", real() - 0.1});
  return run;
}

inline std::vector<CampaignRun> SyntheticRuns(std::uint64_t from, std::uint64_t to) {
  std::vector<CampaignRun> runs;
  for (std::uint64_t number = from; number < to; ++number) runs.push_back(SyntheticRun(number));
  return runs;
}

}  // namespace tiltproof::harness
