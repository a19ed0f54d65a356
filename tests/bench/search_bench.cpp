// The search for the least robust flight beside random points, and beside NLopt where libnlopt-cxx-dev is installed:
// evaluations up to the first failure, for planted triggers and for problems of the falsification competition ARCH-COMP.
//
//   bench_search [SEEDS]   // 20
//
// Chasing cars (Hu, Lygeros, Sastry, Towards a Theory of Stochastic Hybrid Systems, HSCC 2000; in the form of ARCH-COMP):
// five cars run towards minus infinity. The first has a throttle and a brake, and each other one chases the car before it,
// keeps its distance, or brakes. The requirements are judged by the product's own temporal logic, on rows of 0.1 s.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "harness/formula/formula.h"
#include "harness/run/trace.h"
#include "harness/score/stl.h"
#include "tests/harness/campaign/planted_triggers.h"
#ifdef TILTPROOF_HAS_NLOPT
#include <nlopt.hpp>
#endif

namespace tiltproof::harness {
namespace {

using testing::PlantedTrigger;
using testing::Robustness;

constexpr double kStep_s = 0.01, kRow_s = 0.1, kEnd_s = 100;

struct Follower {
  enum class Mode { kChasing, kKeeping, kBraking };
  double y = 0, v = 0;
  Mode mode = Mode::kChasing;

  void Step(double ahead) {
    const double gap = y - ahead;
    if (mode == Mode::kChasing && gap <= 10)
      mode = Mode::kKeeping;
    else if (mode == Mode::kKeeping && gap >= 15)
      mode = Mode::kChasing;
    else if (mode == Mode::kKeeping && gap <= 5)
      mode = Mode::kBraking;
    else if (mode == Mode::kBraking && gap >= 20)
      mode = Mode::kChasing;
    const double dv = mode == Mode::kChasing ? 1 : mode == Mode::kBraking ? -v : 0;
    y += kStep_s * (mode == Mode::kKeeping ? v : -v);
    v += kStep_s * dv;
  }
};

// `inputs`: throttle and brake, constant in equal parts of the time.
Trace ChasingCars(const SearchPoint& inputs) {
  Trace trace(std::vector<std::string>{"t_s", "y1", "y2", "y3", "y4", "y5"});
  double y = 0, v = 0;
  std::array<Follower, 4> followers;
  for (std::size_t i = 0; i < 4; ++i) followers[i].y = 10 * static_cast<double>(i + 1);
  const std::size_t parts = inputs.size() / 2;
  const auto steps = static_cast<std::size_t>(kEnd_s / kStep_s + 0.5);
  constexpr std::size_t each = 10;
  for (std::size_t step = 0; step <= steps; ++step) {
    if (step % each == 0) {
      const std::span<double> row = trace.AppendRow();
      row[0] = static_cast<double>(step / each) * kRow_s;
      row[1] = y;
      for (std::size_t i = 0; i < 4; ++i) row[2 + i] = followers[i].y;
    }
    const std::size_t part = std::min(step * parts / steps, parts - 1);
    double ahead = y;
    const double dv = -inputs[2 * part] - inputs[2 * part + 1] * v;
    y += kStep_s * v;
    v += kStep_s * dv;
    for (Follower& follower : followers) {
      follower.Step(ahead);
      ahead = follower.y;
    }
  }
  return trace;
}

PlantedTrigger Cars(const std::string& name, const std::string& formula, std::size_t parts) {
  return {name + ", " + std::to_string(parts) + " parts", std::vector<SearchAxis>(2 * parts),
          [formula](faults::Random&) -> Robustness {
            const std::vector<std::string> signals = {"t_s", "y1", "y2", "y3", "y4", "y5"};
            const stl::Formula parsed = stl::Parse(formula, {.signals = signals});
            return [parsed](const SearchPoint& point) {
              const stl::Result result = stl::Evaluate(parsed, ChasingCars(point));
              return result.truth == stl::Truth::kFalse ? std::min(result.upper, -1e-9) : result.lower;
            };
          }};
}

std::vector<PlantedTrigger> Problems() {
  std::vector<PlantedTrigger> problems = testing::PlantedTriggers();
  for (const std::size_t parts : {5U, 20U}) {
    problems.push_back(Cars("CC1", "always[0,100](y5 - y4 <= 40)", parts));
    problems.push_back(Cars("CC2", "always[0,70](eventually[0,30](y5 - y4 >= 15))", parts));
    problems.push_back(
        Cars("CC3", "always[0,80](always[0,20](y2 - y1 <= 20) or eventually[0,20](y5 - y4 >= 40))", parts));
    problems.push_back(Cars("CC4", "always[0,65](eventually[0,30](always[0,5](y5 - y4 >= 8)))", parts));
  }
  return problems;
}

using Method = std::function<std::size_t(const PlantedTrigger&, const Robustness&, std::uint64_t seed,
                                         std::size_t count_max)>;

#ifdef TILTPROOF_HAS_NLOPT
Method Nlopt(nlopt::algorithm algorithm) {
  return [algorithm](const PlantedTrigger& trigger, const Robustness& robustness, std::uint64_t seed,
                     std::size_t count_max) {
    struct Run {
      const PlantedTrigger& trigger;
      const Robustness& robustness;
      std::size_t count = 0, first = 0;
    } run{trigger, robustness};
    const auto evaluate = [](const std::vector<double>& x, std::vector<double>&, void* data) {
      Run& of = *static_cast<Run*>(data);
      SearchPoint point = x;
      for (std::size_t i = 0; i < point.size(); ++i)
        if (const int values = of.trigger.axes[i].values_count; values > 0)
          point[i] = std::min(std::floor(point[i] * values), values - 1.0);
      ++of.count;
      const double value = of.robustness(point);
      if (value < 0 && of.first == 0) of.first = of.count;
      return value;
    };
    nlopt::srand(seed + 1);
    nlopt::opt optimiser(algorithm, static_cast<unsigned>(trigger.axes.size()));
    optimiser.set_lower_bounds(0.0);
    optimiser.set_upper_bounds(1.0);
    optimiser.set_maxeval(static_cast<int>(count_max));
    optimiser.set_stopval(0.0);
    optimiser.set_min_objective(evaluate, &run);
    std::vector<double> x(trigger.axes.size(), 0.5);
    double least = 0;
    try {
      optimiser.optimize(x, least);
    } catch (const std::exception&) {  // rounding ends a search
    }
    return run.first > 0 && run.first <= count_max ? run.first : count_max + 1;
  };
}
#endif

int Main(int argc, char** argv) {
  const auto seeds = static_cast<std::size_t>(argc > 1 ? std::atoi(argv[1]) : 20);
  constexpr std::size_t kCountMax = 200;
  std::vector<std::pair<std::string, Method>> methods = {
      {"search", testing::FirstFailure},
      {"random", [](const PlantedTrigger& trigger, const Robustness& robustness, std::uint64_t seed,
                    std::size_t count_max) {
         faults::Random random(faults::KeyOf(faults::StreamKey(seed, {"random"}), 0));
         return testing::FirstRandomFailure(trigger, robustness, random, count_max);
       }}};
#ifdef TILTPROOF_HAS_NLOPT
  methods.emplace_back("DIRECT", Nlopt(nlopt::GN_DIRECT));
  methods.emplace_back("DIRECT-L", Nlopt(nlopt::GN_DIRECT_L));
  methods.emplace_back("CRS2", Nlopt(nlopt::GN_CRS2_LM));
  methods.emplace_back("ESCH", Nlopt(nlopt::GN_ESCH));
#endif
  std::printf("Evaluations to the first failure: median of %zu seeds (share found), %zu at most\n%-36s",
              seeds, kCountMax, "");
  for (const auto& [name, method] : methods) std::printf(" %13s", name.c_str());
  for (const PlantedTrigger& problem : Problems()) {
    std::printf("\n%-36s", problem.name.c_str());
    for (const auto& [name, method] : methods) {
      std::vector<std::size_t> counts;
      std::size_t found = 0;
      for (std::size_t seed = 0; seed < seeds; ++seed) {
        faults::Random random(faults::KeyOf(faults::StreamKey(1, {"planted", problem.name}), seed));
        counts.push_back(method(problem, problem.plant(random), seed, kCountMax));
        found += counts.back() <= kCountMax ? 1 : 0;
      }
      std::sort(counts.begin(), counts.end());
      const std::size_t median = counts[seeds / 2];
      std::printf(" %6s (%3zu%%)", median > kCountMax ? ">200" : std::to_string(median).c_str(),
                  100 * found / seeds);
      std::fflush(stdout);
    }
  }
  std::printf("\n");
  return 0;
}

}  // namespace
}  // namespace tiltproof::harness

int main(int argc, char** argv) { return tiltproof::harness::Main(argc, argv); }
