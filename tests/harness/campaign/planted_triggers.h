// Functions with a narrow region below 0, as the robustness of flights in which only one rare combination fails. Each
// is planted at another place for each draw. A uniformly random point hits it with a chance of 1e-4 at most.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "faults/random.h"
#include "harness/campaign/robustness_search.h"

namespace tiltproof::harness::testing {

using Robustness = std::function<double(const SearchPoint&)>;

struct PlantedTrigger {
  std::string name;
  std::vector<SearchAxis> axes;
  std::function<Robustness(faults::Random&)> plant;
};

inline std::vector<double> Places(faults::Random& random, std::size_t count, double margin) {
  std::vector<double> places(count);
  for (double& place : places) place = margin + (1 - 2 * margin) * random.Uniform();
  return places;
}

// Numbers with a chance of width^count together: the largest distance decides.
inline PlantedTrigger Box(std::string name, std::size_t count, double width) {
  return {std::move(name), std::vector<SearchAxis>(count), [=](faults::Random& random) -> Robustness {
            return [=, at = Places(random, count, width / 2)](const SearchPoint& point) {
              double far = 0;
              for (std::size_t i = 0; i < count; ++i) far = std::max(far, std::abs(point[i] - at[i]));
              return far - width / 2;
            };
          }};
}

inline std::vector<PlantedTrigger> PlantedTriggers() {
  std::vector<PlantedTrigger> triggers;
  triggers.push_back(Box("two numbers, 1 % each", 2, 0.01));
  triggers.push_back(Box("four numbers, 10 % each", 4, 0.1));
  // One of four actuators; of the others nothing but that they are wrong is seen.
  triggers.push_back({"one of four names and three numbers",
                      {{.values_count = 4, .ordered = false}, {}, {}, {}},
                      [](faults::Random& random) -> Robustness {
                        const double name = static_cast<double>(random.Below(4));
                        return [=, at = Places(random, 3, 0.1)](const SearchPoint& point) {
                          const double far =
                              std::max({std::abs(point[1] - at[0]) / 0.01, std::abs(point[2] - at[1]) / 0.05,
                                        std::abs(point[3] - at[2]) / 0.1});
                          return (point[0] == name ? 0 : 1.2) + (far - 1) / 20;
                        };
                      }});
  triggers.push_back({"a bent valley", {{}, {}}, [](faults::Random& random) -> Robustness {
                        const double at = 0.1 + 0.8 * random.Uniform();
                        const double bend = 1 + 4 * random.Uniform();
                        return [=](const SearchPoint& point) {
                          const double x = point[0] - 0.5;
                          return 2 * std::abs(point[1] - 0.3 - bend * 0.4 * x * x) +
                                 0.5 * std::abs(point[0] - at) - 0.006;
                        };
                      }});
  // Criteria of different scales, the smallest margin of which counts.
  triggers.push_back(
      {"six numbers of unequal effect", std::vector<SearchAxis>(6), [](faults::Random& random) -> Robustness {
         return [at = Places(random, 6, 0.1)](const SearchPoint& point) {
           double most = -1;
           for (std::size_t i = 0; i < 6; ++i)
             most = std::max(most, (i % 2 == 1 ? 1 : 0.3) * (std::abs(point[i] - at[i]) - 0.1));
           return most;
         };
       }});
  // Start, length and severity of a window whose end must come at one moment. Elsewhere the robustness is flat.
  triggers.push_back({"a window that must hit", {{}, {}, {}}, [](faults::Random& random) -> Robustness {
                        const double moment = 0.1 + 0.8 * random.Uniform();
                        return [=](const SearchPoint& point) {
                          const double late = std::abs(point[0] + 0.02 + 0.1 * point[1] - moment);
                          const double near = std::max(0.0, 1 - late / 0.15);
                          return 0.97 - near * point[2] * std::min(1.0, 0.4 + point[1]);
                        };
                      }});
  // A margin in coarse steps, as that of a metric that counts.
  triggers.push_back({"stairs with a whole number",
                      {{}, {}, {.values_count = 10}},
                      [](faults::Random& random) -> Robustness {
                        const double whole = static_cast<double>(random.Below(10));
                        return [=, at = Places(random, 2, 0.05)](const SearchPoint& point) {
                          const double far =
                              std::max({std::abs(point[0] - at[0]) / 0.016,
                                        std::abs(point[1] - at[1]) / 0.015, std::abs(point[2] - whole) * 2});
                          return std::ceil(far - 1) * 0.02 - 0.001;
                        };
                      }});
  triggers.push_back(
      {"a corner of five numbers", std::vector<SearchAxis>(5), [](faults::Random& random) -> Robustness {
         std::vector<double> at(5);
         for (double& place : at) place = random.Bernoulli(0.5) ? 1 : 0;
         return [=](const SearchPoint& point) {
           double sum = -0.4;
           for (std::size_t i = 0; i < 5; ++i) sum += std::abs(point[i] - at[i]);
           return sum;
         };
       }});
  // A wide basin that never fails leads away from a narrow one.
  triggers.push_back({"beside a decoy", {{}, {}, {}}, [](faults::Random& random) -> Robustness {
                        const auto at = Places(random, 3, 0.1), decoy = Places(random, 3, 0.1);
                        return [=](const SearchPoint& point) {
                          double near = 0, lured = 0;
                          for (std::size_t i = 0; i < 3; ++i) {
                            near += (point[i] - at[i]) * (point[i] - at[i]);
                            lured += (point[i] - decoy[i]) * (point[i] - decoy[i]);
                          }
                          return std::min(0.1 + 0.5 * std::sqrt(lured), 2.5 * std::sqrt(near) - 0.07);
                        };
                      }});
  return triggers;
}

// The first evaluation below 0, from 1; count_max + 1 when there is none.
inline std::size_t FirstFailure(const PlantedTrigger& trigger, const Robustness& robustness,
                                std::uint64_t seed, std::size_t count_max) {
  RobustnessSearch search(trigger.axes, faults::StreamKey(seed, {"search"}));
  while (search.told_count() < count_max) {
    std::vector<double> told;
    for (const SearchPoint& point : search.Ask()) {
      told.push_back(robustness(point));
      if (told.back() < 0) return std::min(search.told_count() + told.size(), count_max + 1);
    }
    search.Tell(told);
  }
  return count_max + 1;
}

// The same for points that are drawn uniformly.
inline std::size_t FirstRandomFailure(const PlantedTrigger& trigger, const Robustness& robustness,
                                      faults::Random& random, std::size_t count_max) {
  SearchPoint point(trigger.axes.size());
  for (std::size_t count = 1; count <= count_max; ++count) {
    for (std::size_t axis = 0; axis < point.size(); ++axis) {
      const int values = trigger.axes[axis].values_count;
      point[axis] = values == 0 ? random.Uniform()
                                : static_cast<double>(random.Below(static_cast<std::uint64_t>(values)));
    }
    if (robustness(point) < 0) return count;
  }
  return count_max + 1;
}

}  // namespace tiltproof::harness::testing
